//! A problem on a surface as a simulation: the first step constructs the operators, every step is the problem's.

use super::cloud::SurfaceCloud;
use super::format_1;
use super::method::{Form, Method, Operators};
use super::problem::{Problem, Tools};
use super::quantities::{CURVATURE, NORMAL, TIME};
use crate::linear_algebra::SparseRows;
use crate::operators::{Support, SupportDiagnostics};
use crate::parallel::Interrupt;
use crate::schemes::measured_errors::{SUPPORTS, support_diagnostics};
use crate::simulation::course::check_finite;
use crate::simulation::{
    Check, Course, CpuClock, Diagnostic, Fields, Finding, Health, LoadError, Mark, Observables, Phases, Report,
    Section, Selection, Simulation, StepError,
};
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

/// A problem on a surface in D dimensions, M = D − 1.
pub struct SurfaceEquation<const D: usize, const M: usize> {
    cloud: SurfaceCloud<D>,
    method: Method,
    problem: Box<dyn Problem<D>>,
    operators: Option<Operators>,
    fit_diagnostics: SupportDiagnostics,
    /// Points whose curvature is too large for their support.
    coarse: u64,
    interrupt: Interrupt,
    /// Of points from outside: what they are, for the report.
    origin: Option<String>,
    /// Points from outside that findings are about.
    marks: Vec<Mark>,
    course: Course,
}

/// |κ| r_c beyond which a fit does not see the surface as nearly flat.
const COARSE: f64 = 0.5;

/// Points of a curvature, exact or else fitted, that is large for their support.
fn coarse_points<const D: usize>(cloud: &SurfaceCloud<D>, method: &Method, built: &Operators) -> u64 {
    let fitted = |i: usize| built.curvatures.as_ref().map_or(f64::NAN, |curvatures| curvatures[i][0]);
    let is_coarse = |i: &usize| {
        // Of points from outside no exact one is known.
        let known = cloud.curvatures.get(*i).copied().unwrap_or(f64::NAN);
        let kappa = if known.is_nan() { fitted(*i) } else { known };
        let scale = cloud.scales.get(*i).copied().unwrap_or(1.0);
        kappa.abs() * scale * method.support.radius > COARSE
    };
    (0..cloud.rows).filter(is_coarse).count() as u64
}

impl<const D: usize, const M: usize> SurfaceEquation<D, M> {
    /// At the start: nothing is computed yet.
    #[must_use]
    pub fn new(
        cloud: SurfaceCloud<D>,
        method: Method,
        problem: Box<dyn Problem<D>>,
        fixed: FixedStep,
        interrupt: Interrupt,
        cpu_clock: CpuClock,
    ) -> Self {
        Self {
            cloud,
            method,
            problem,
            operators: None,
            fit_diagnostics: SupportDiagnostics::default(),
            coarse: 0,
            interrupt,
            origin: None,
            marks: Vec::new(),
            course: Course::new(fixed.into(), Phases::new(cpu_clock), BTreeMap::new()),
        }
    }

    /// The same on points from outside: what they are, and what is wrong with them.
    #[must_use]
    pub fn on_points(mut self, origin: String, findings: Vec<Finding>, marks: Vec<Mark>) -> Self {
        (self.origin, self.course.findings, self.marks) = (Some(origin), findings, marks);
        self
    }
}

impl<const D: usize, const M: usize> Simulation for SurfaceEquation<D, M> {
    fn course(&self) -> &Course {
        &self.course
    }

    fn course_mut(&mut self) -> &mut Course {
        &mut self.course
    }

    /// 1. Operators, where there are none yet: a row for every point. 2. The problem's step. 3. A look at the numbers.
    fn step(&mut self) -> Result<(), StepError> {
        let Self { cloud, method, problem, operators, course, interrupt, fit_diagnostics, coarse, .. } = self;
        let (from, to) = (course.clock(), course.next());
        let phases = &mut course.phases;
        let operators = match operators {
            Some(operators) => operators,
            None => {
                let wanted = problem.wanted();
                let build = || method.build::<D, M>(cloud, &wanted, interrupt);
                let built = phases.measure("operators/construction", build)?;
                (*fit_diagnostics, *coarse) = (built.fit_diagnostics, coarse_points(cloud, method, &built));
                if let Some(first) = fit_diagnostics.first_failed {
                    let (failed, Clock { step, time }) = (fit_diagnostics.failed, to);
                    let reason = format!(
                        "the moment conditions of {failed} of {} points cannot be met, the first is point {first}; a larger \
                         cutoff_dn or relaxed sampling helps",
                        cloud.rows
                    );
                    return Err(StepError::Unsolved { reason, step, time });
                }
                operators.insert(built)
            }
        };
        problem.step(Tools { cloud, operators, interrupt, phases, from, to })?;
        interrupt.check()?;
        for (field, values) in problem.watched() {
            check_finite(field, values, to)?;
        }
        course.step += 1;
        Ok(())
    }

    fn observables(&self) -> Observables {
        let clock = self.clock();
        let mut row: Observables = vec![(&TIME, clock.time)];
        row.extend(self.problem.observables(&self.cloud, clock));
        row
    }

    fn fields<'a>(&self, selection: Selection<'a>) -> Fields<'a> {
        let rows = self.cloud.rows;
        let mut fields = Fields::new(&self.cloud.points[..rows], selection);
        for quantity in self.problem.columns() {
            fields.scalar(quantity, || self.problem.column(quantity, self.clock()));
        }
        fields.vector(&NORMAL, || self.cloud.normals[..rows].iter().copied());
        if !self.cloud.curvatures.is_empty() {
            fields.scalar(&CURVATURE, || self.cloud.curvatures.clone());
        }
        fields.particle_id();
        fields.marks.clone_from(&self.marks);
        fields
    }

    fn save(&self, state: &mut Section) {
        self.course.save(state);
        state.put_section("problem", |section| self.problem.save(section));
        state.put_component("fits", &self.fit_diagnostics);
        state.put_count("coarse_points", self.coarse);
    }

    fn load(&mut self, state: &Section) -> Result<(), LoadError> {
        let clock = self.course.check(state)?;
        let (soundness, coarse) = (state.component("fits")?, state.count("coarse_points")?);
        state.section("problem", |section| self.problem.load(section))?;
        // From here on nothing fails.
        (self.fit_diagnostics, self.coarse) = (soundness, coarse);
        // They are a function of the points alone; the next step makes them again.
        self.operators = None;
        if clock.step > 0 {
            // They were told at the start.
            self.course.findings.clear();
        }
        self.course.step = clock.step;
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        format_1::translate(arrays, self.problem.translate_format_1(arrays)?)
    }

    fn report(&self) -> Report {
        let Support { degree, radius } = self.method.support;
        let form = match self.method.form {
            Form::Intrinsic { .. } => "tangent planes".to_owned(),
            Form::Copies { layers, spacing } => format!("{layers} copies to either side, {spacing:.6} apart"),
        };
        let entries = self.operators.iter().flat_map(|o| &o.rows).map(SparseRows::entries).sum::<usize>();
        let mut method = BTreeMap::from([("operator", format!("degree {degree}, support {radius:.6}, {form}"))]);
        if entries > 0 {
            method.insert("entries", format!("{:.1} a point", entries as f64 / self.cloud.rows as f64));
        }
        method.extend(self.origin.iter().map(|origin| ("points", origin.clone())));
        self.problem.describe(&mut method);
        let mut diagnostics = support_diagnostics(SUPPORTS, &self.fit_diagnostics);
        let doc = "Points whose curvature is too large for their support.";
        diagnostics.push(Diagnostic::count("supports.coarse", self.coarse, doc));
        diagnostics.extend(self.problem.diagnostics());
        Report { errors: self.problem.errors(&self.cloud, self.clock()), health: self.health(), diagnostics, method }
    }

    fn health(&self) -> Health {
        let finite = self.problem.watched().iter().all(|(_, values)| values.iter().all(|value| value.is_finite()));
        let unmet = (self.course.step > 0).then_some(self.fit_diagnostics.failed as f64);
        let mut checks = vec![Check::at_most("unmet_moment_conditions", unmet, 0.0, "points")];
        checks.extend(self.problem.checks(self.course.step));
        Health { finite, max_cfl: 0.0, volume_drift: None, checks }
    }

    fn particle_count(&self) -> usize {
        self.cloud.rows
    }
}
