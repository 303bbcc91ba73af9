//! A problem on a surface as a simulation: the first step constructs the operators, every step is the problem's.

use super::cloud::SurfaceCloud;
use super::format_1;
use super::method::{Form, Method, Operators, Use, Wanted};
use super::problem::{Problem, Tools};
use super::quantities::{CURVATURE, NORMAL, TIME};
use super::row_quality::RowQuality;
use crate::geometry::Vector;
use crate::geometry::frame::tangents;
use crate::linear_algebra::SparseRows;
use crate::operators::{Support, SupportDiagnostics};
use crate::parallel::Interrupt;
use crate::schemes::measured_errors::{SUPPORTS, support_diagnostics};
use crate::simulation::course::check_finite;
use crate::simulation::{
    Check, Course, CpuClock, Diagnostic, Fields, Finding, Health, LoadError, Mark, NamedOperator, Observables, Phases,
    Region, Report, Section, Selection, Simulation, StepError,
};
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

/// A problem on a surface in D dimensions, M = D − 1.
pub struct SurfaceEquation<const D: usize, const M: usize> {
    cloud: SurfaceCloud<D>,
    method: Method,
    problem: Box<dyn Problem<D>>,
    operators: Option<Operators>,
    /// Normals of the fitted surface, where heights were fitted along stars; empty before.
    fitted_normals: Vec<Vector<D>>,
    /// Whether fits of order 2 took the place of those of a higher one.
    is_lowered: bool,
    fit_diagnostics: SupportDiagnostics,
    /// Of fits by stars: kinds of rows.
    quality: Option<RowQuality>,
    /// Points whose curvature is too large for their support.
    coarse: u64,
    interrupt: Interrupt,
    /// Of points from outside: what they are, for the report.
    origin: Option<String>,
    /// Points from outside that findings are about.
    marks: Vec<Mark>,
    /// What was counted when the points were prepared.
    preparation: Vec<Diagnostic>,
    course: Course,
}

/// |κ| r_c beyond which a fit does not see the surface as nearly flat.
const COARSE: f64 = 0.5;

/// Slopes of the fitted surface over the tangent plane of a point beyond which they are no correction of its normal.
const MOST_SLOPE: f64 = 0.3;

/// The normals n − Σ h_a t_a of fitted heights with slopes h_a over the planes of normals n.
fn fitted_normals<const D: usize, const M: usize>(cloud: &SurfaceCloud<D>, slopes: &[[f64; 2]]) -> Vec<Vector<D>> {
    let at = |(n, slopes): (&Vector<D>, &[f64; 2])| {
        let slopes = &slopes[..M];
        let steepness = slopes.iter().map(|slope| slope * slope).sum::<f64>().sqrt();
        if steepness.is_nan() || steepness > MOST_SLOPE {
            return *n;
        }
        let tangents = tangents::<D, M>(n);
        slopes.iter().zip(tangents).fold(*n, |normal, (slope, t)| normal - t * *slope).normalize()
    };
    cloud.normals.iter().zip(slopes).map(at).collect()
}

/// Points of a curvature, exact or else fitted, that is large for their support.
fn coarse_points<const D: usize>(cloud: &SurfaceCloud<D>, method: &Method, built: &Operators) -> u64 {
    let fitted = |i: usize| built.curvatures.as_ref().map_or(f64::NAN, |curvatures| curvatures[i][0]);
    let is_coarse = |i: &usize| {
        // Of points from outside no exact one is known.
        let known = cloud.curvatures.get(*i).copied().unwrap_or(f64::NAN);
        let kappa = if known.is_nan() { fitted(*i) } else { known };
        let scale = cloud.scales.get(*i).copied().unwrap_or(1.0);
        let radius = match method.form {
            Form::Stars { cutoff, .. } => cutoff * cloud.spacings[*i],
            _ => scale * method.support.radius,
        };
        kappa.abs() * radius > COARSE
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
            fitted_normals: Vec::new(),
            is_lowered: false,
            fit_diagnostics: SupportDiagnostics::default(),
            quality: None,
            coarse: 0,
            interrupt,
            origin: None,
            marks: Vec::new(),
            preparation: Vec::new(),
            course: Course::new(fixed.into(), Phases::new(cpu_clock), BTreeMap::new()),
        }
    }

    /// The same on points from outside: what they are, and what is wrong with them.
    #[must_use]
    pub fn on_points(mut self, origin: String, findings: Vec<Finding>, marks: Vec<Mark>) -> Self {
        (self.origin, self.course.findings, self.marks) = (Some(origin), findings, marks);
        self
    }

    /// The same with what was counted when the points were prepared.
    #[must_use]
    pub fn with_preparation(mut self, counted: Vec<Diagnostic>) -> Self {
        self.preparation = counted;
        self
    }
}

impl<const D: usize, const M: usize> SurfaceEquation<D, M> {
    /// Makes the operators. Their doubts are told in the first step; a run that goes on makes them again in silence.
    fn construct_operators(&mut self) -> Result<(), StepError> {
        let Self { cloud, method, problem, course, interrupt, .. } = self;
        let (from, to) = (course.clock(), course.next());
        let wanted = problem.wanted();
        let build = || method.build::<D, M>(cloud, &wanted, problem.purpose(), interrupt);
        let built = course.phases.measure("operators/construction", build)?;
        self.fit_diagnostics = built.fit_diagnostics;
        self.coarse = coarse_points(cloud, method, &built);
        if let Some(first) = built.fit_diagnostics.first_failed {
            let (failed, Clock { step, time }) = (built.fit_diagnostics.failed, to);
            let reason = format!(
                "the moment conditions of {failed} of {} points cannot be met, the first is point {first}; a larger \
                 cutoff_dn or relaxed sampling helps",
                cloud.rows
            );
            return Err(StepError::Unsolved { reason, step, time });
        }
        if from.step == 0 {
            course.findings.extend(findings_of(&built, problem.purpose(), method, to));
        }
        self.quality.clone_from(&built.quality);
        self.fitted_normals = fitted_normals::<D, M>(cloud, &built.slopes);
        self.is_lowered = built.is_lowered;
        self.operators = Some(built);
        Ok(())
    }

    /// Why the conservative form took the place of rows, if it did.
    fn reason_to_switch(&self) -> Option<String> {
        let may_switch = matches!(self.method.form, Form::Stars { may_switch: true, .. });
        let quality = self.quality.as_ref().filter(|_| may_switch && self.problem.purpose() == Use::Equation);
        quality.and_then(RowQuality::reason_to_switch)
    }

    /// What the operators are, and why.
    fn operator_name(&self) -> String {
        let Support { degree, radius } = self.method.support;
        let rows = format!("degree {degree}, support {radius:.6}");
        match self.method.form {
            Form::Intrinsic { .. } => format!("{rows}, tangent planes"),
            Form::Copies { layers, spacing } => {
                format!("{rows}, {layers} copies to either side, {spacing:.6} apart")
            }
            Form::Stars { cutoff, .. } => match self.reason_to_switch() {
                Some(reason) => format!("conservative: {reason}"),
                _ if self.is_lowered => {
                    format!(
                        "rows: degree 3, since more than 0.2 % of the points have no bounded fit of degree {degree}"
                    )
                }
                _ => format!("rows: degree {degree}, supports of {cutoff} local spacings along stars"),
            },
            Form::Conservative => "conservative: asked for".to_owned(),
        }
    }
}

/// Findings about operators that were just made.
fn findings_of(built: &Operators, purpose: Use, method: &Method, to: Clock) -> Vec<Finding> {
    let Some(quality) = &built.quality else { return Vec::new() };
    let at = (to.step, to.time);
    let mut findings = Vec::new();
    if built.is_conservative {
        let reason = quality.reason_to_switch().unwrap_or_default();
        let message = format!("the conservative form takes the place of fits, since {reason}");
        // Second order is all that it has.
        let finding = if method.support.degree > 3 { Finding::warning } else { Finding::info };
        findings.push(finding("operator.conservative", message, at));
    } else if purpose == Use::Equation && quality.has_growing_modes() {
        let message = format!(
            "the operator has growing modes: the largest Ritz value is {:.1e} of its largest weight",
            quality.growth()
        );
        let advice = "the methods `auto` and `conservative` have none";
        findings.push(Finding::warning("operator.growing_modes", message, at).with_advice(advice));
    }
    if !built.is_conservative {
        findings.extend(quality.finding_of_fallbacks(at));
    }
    let (count, first) = quality.voronoi();
    if purpose == Use::Pointwise && count > 0 {
        let message =
            format!("{count} points have no consistent row: there are too few points for the bends of the surface");
        findings.push(Finding::warning("operator.voronoi_rows", message, at).about(first).with_count(count));
    }
    findings
}

impl<const D: usize, const M: usize> Simulation for SurfaceEquation<D, M> {
    fn course(&self) -> &Course {
        &self.course
    }

    fn course_mut(&mut self) -> &mut Course {
        &mut self.course
    }

    /// 1. Operators, where there are none yet: a row for every point. 2. The problem's step. 3. A look at the numbers.
    fn advance(&mut self) -> Result<(), StepError> {
        if self.operators.is_none() {
            self.construct_operators()?;
        }
        let Self { cloud, problem, operators: Some(operators), course, interrupt, .. } = self else {
            let Clock { step, time } = self.clock();
            return Err(StepError::Unsolved { reason: "there are no operators".to_owned(), step, time });
        };
        let (from, to) = (course.clock(), course.next());
        problem.step(Tools { cloud, operators, interrupt, phases: &mut course.phases, from, to })?;
        interrupt.check()?;
        for (field, values) in problem.watched() {
            check_finite(field, values, to)?;
        }
        course.findings.extend(problem.findings(to));
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
        for quantity in self.problem.vector_columns() {
            fields.vector(quantity, || self.problem.vector_column(quantity, &self.cloud).into_iter());
        }
        let normals = if self.fitted_normals.is_empty() { &self.cloud.normals } else { &self.fitted_normals };
        fields.vector(&NORMAL, || normals[..rows].iter().copied());
        if !self.cloud.curvatures.is_empty() {
            fields.scalar(&CURVATURE, || self.cloud.curvatures.clone());
        }
        fields.particle_id();
        fields.marks.clone_from(&self.marks);
        fields.triangles.clone_from(&self.cloud.triangles);
        fields
    }

    fn save(&self, state: &mut Section) {
        self.course.save(state);
        state.put_section("problem", |section| self.problem.save(section));
        state.put_component("fits", &self.fit_diagnostics);
        state.put_count("coarse_points", self.coarse);
        if let Some(quality) = &self.quality {
            state.put_component("quality", quality);
            state.put_count("is_lowered", u64::from(self.is_lowered));
        }
    }

    fn load(&mut self, state: &Section) -> Result<(), LoadError> {
        let clock = self.course.check(state)?;
        let (soundness, coarse) = (state.component("fits")?, state.count("coarse_points")?);
        let is_lowered = state.has("is_lowered") && state.count("is_lowered")? > 0;
        let quality = if state.has("quality") { Some(state.component("quality")?) } else { None };
        state.section("problem", |section| self.problem.load(section))?;
        // From here on nothing fails.
        (self.fit_diagnostics, self.coarse, self.quality) = (soundness, coarse, quality);
        self.is_lowered = is_lowered;
        // They are a function of the points alone; the next step makes them again.
        self.operators = None;
        self.fitted_normals.clear();
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
        let entries = self.operators.iter().flat_map(|o| &o.rows).map(SparseRows::entries).sum::<usize>();
        let mut method = BTreeMap::from([("operator", self.operator_name())]);
        if entries > 0 {
            method.insert("entries", format!("{:.1} a point", entries as f64 / self.cloud.rows as f64));
        }
        method.extend(self.origin.iter().map(|origin| ("points", origin.clone())));
        self.problem.describe(&mut method);
        let mut diagnostics = self.preparation.clone();
        match &self.quality {
            Some(quality) => diagnostics.extend(quality.diagnostics()),
            None => diagnostics.extend(support_diagnostics(SUPPORTS, &self.fit_diagnostics)),
        }
        let doc = "Points whose curvature is too large for their support.";
        diagnostics.push(Diagnostic::count("supports.coarse", self.coarse, doc));
        diagnostics.extend(self.problem.diagnostics());
        Report { errors: self.problem.errors(&self.cloud, self.clock()), health: self.health(), diagnostics, method }
    }

    fn operators(&mut self) -> Result<Vec<NamedOperator<'_>>, StepError> {
        if self.operators.is_none() {
            self.construct_operators()?;
        }
        let Some(operators) = &self.operators else { return Ok(Vec::new()) };
        let areas = self.cloud.cell_areas();
        let named = |(wanted, rows): (Wanted, _)| NamedOperator { name: wanted.name(), rows, areas };
        Ok(self.problem.wanted().into_iter().zip(&operators.rows).map(named).collect())
    }

    fn health(&self) -> Health {
        let finite = self.problem.watched().iter().all(|(_, values)| values.iter().all(|value| value.is_finite()));
        let unmet = (self.course.step > 0).then_some(self.fit_diagnostics.failed as f64);
        let mut checks = vec![Check::at_most("unmet_moment_conditions", unmet, 0.0, "points")];
        if let Some(quality) = &self.quality {
            checks.push(quality.check_of_fallbacks(self.reason_to_switch().is_none()));
            checks.push(Check::watched("growing_modes", Some(quality.growth()), ""));
        }
        checks.extend(self.problem.checks(self.course.step));
        Health { finite, max_cfl: 0.0, volume_drift: None, checks }
    }

    fn weights(&self, region: Region) -> Option<Vec<f64>> {
        matches!(region, Region::All | Region::Surface).then(|| self.cloud.weights())
    }

    fn particle_count(&self) -> usize {
        self.cloud.rows
    }
}
