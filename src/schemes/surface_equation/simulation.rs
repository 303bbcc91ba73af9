//! A problem on a surface as a simulation: the first step constructs the operators, every step is the problem's.

use super::cloud::SurfaceCloud;
use super::method::{Form, Method, Operators};
use super::problem::{Problem, Tools};
use crate::linear_algebra::SparseRows;
use crate::operators::{Support, SupportDiagnostics};
use crate::parallel::Interrupt;
use crate::simulation::report::Newton;
use crate::simulation::state::check_length;
use crate::simulation::{
    CpuClock, Fields, Finding, Health, Observables, Phases, Report, RestoreError, Simulation, State, StepError,
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
    fixed: FixedStep,
    step: u64,
    interrupt: Interrupt,
    phases: Phases,
    /// Of points from outside: what they are, for the report.
    origin: Option<String>,
    /// Of points from outside: what is wrong with them, until it was told.
    findings: Vec<Finding>,
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
        let fit_diagnostics = SupportDiagnostics::default();
        let phases = Phases::new(cpu_clock);
        Self {
            cloud,
            method,
            problem,
            operators: None,
            fit_diagnostics,
            coarse: 0,
            fixed,
            step: 0,
            interrupt,
            phases,
            origin: None,
            findings: Vec::new(),
        }
    }

    /// The same on points from outside: what they are, and what is wrong with them.
    #[must_use]
    pub fn on_points(mut self, origin: String, findings: Vec<Finding>) -> Self {
        (self.origin, self.findings) = (Some(origin), findings);
        self
    }
}

impl<const D: usize, const M: usize> Simulation for SurfaceEquation<D, M> {
    fn clock(&self) -> Clock {
        self.fixed.clock(self.step)
    }

    fn end(&self) -> Clock {
        self.fixed.clock(self.fixed.steps)
    }

    /// 1. Operators, where there are none yet: a row for every point. 2. The problem's step. 3. A look at the numbers.
    fn step(&mut self) -> Result<(), StepError> {
        let Self { cloud, method, problem, operators, phases, interrupt, fit_diagnostics, coarse, fixed, .. } = self;
        let (from, to) = (fixed.clock(self.step), fixed.clock(self.step + 1));
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
            if let Some(particle) = values.iter().position(|value| !value.is_finite()) {
                return Err(StepError::NonFinite { field, particle, step: to.step, time: to.time });
            }
        }
        self.step += 1;
        Ok(())
    }

    fn observables(&self) -> Observables {
        let clock = self.clock();
        let mut row = vec![("time", clock.time)];
        row.extend(self.problem.observables(&self.cloud, clock));
        row
    }

    fn fields(&self) -> Fields {
        let rows = self.cloud.rows;
        let mut fields = Fields::at(&self.cloud.points[..rows]);
        for (name, values) in self.problem.columns(self.clock()) {
            fields.scalar(name, values);
        }
        fields.vector("normal", self.cloud.normals[..rows].iter().copied());
        if !self.cloud.curvatures.is_empty() {
            fields.scalar("curvature", self.cloud.curvatures.clone());
        }
        fields.id("particle_id", (0..rows as u64).collect());
        fields
    }

    fn state(&self) -> State {
        let Clock { step, time } = self.clock();
        let mut state = State { step, time, ..State::default() };
        self.problem.save(&mut state);
        let (counts, min_pivot) = self.fit_diagnostics.to_numbers();
        state.push_counts("soundness", counts.to_vec());
        state.push_counts("coarse", vec![self.coarse]);
        state.push_reals("least_pivot", &[min_pivot]);
        state
    }

    fn restore(&mut self, state: &State) -> Result<(), RestoreError> {
        if state.step > self.fixed.steps {
            return Err(RestoreError::Beyond { step: state.step, last: self.fixed.steps });
        }
        let (counts, coarse, pivot) =
            (state.counts("soundness")?, state.counts("coarse")?, state.reals("least_pivot")?);
        check_length("soundness", counts.len(), 4)?;
        check_length("coarse", coarse.len(), 1)?;
        check_length("least_pivot", pivot.len(), 1)?;
        self.problem.load(state)?;
        self.fit_diagnostics = SupportDiagnostics::from_numbers([counts[0], counts[1], counts[2], counts[3]], pivot[0]);
        self.coarse = coarse[0];
        // They are a function of the points alone; the next step makes them again.
        self.operators = None;
        if state.step > 0 {
            // It was told at the start.
            self.findings.clear();
        }
        self.step = state.step;
        Ok(())
    }

    fn report(&self) -> Report {
        let Support { degree, radius } = self.method.support;
        let form = match self.method.form {
            Form::Intrinsic { .. } => "tangent planes".to_owned(),
            Form::Copies { layers, spacing } => format!("{layers} copies to either side, {spacing:.6} apart"),
        };
        let SupportDiagnostics { enlarged, low_rank, unresolved, failed, min_pivot, .. } = self.fit_diagnostics;
        let rescued = [
            ("supports.larger_radius", enlarged),
            ("supports.low_rank", low_rank),
            ("supports.unresolved", unresolved),
            ("supports.coarse", self.coarse),
            ("rows.failed", failed),
        ];
        let entries = self.operators.iter().flat_map(|o| &o.rows).map(SparseRows::entries).sum::<usize>();
        let mut method = BTreeMap::from([("operator", format!("degree {degree}, support {radius:.6}, {form}"))]);
        if entries > 0 {
            method.insert("entries", format!("{:.1} a point", entries as f64 / self.cloud.rows as f64));
        }
        method.extend(self.origin.iter().map(|origin| ("points", origin.clone())));
        self.problem.describe(&mut method);
        Report {
            errors: self.problem.errors(&self.cloud, self.clock()),
            health: self.health(),
            worst_condition: 1.0 / min_pivot,
            rescued_fits: rescued.into_iter().filter(|(_, count)| *count > 0).collect(),
            newton: Newton::default(),
            method,
        }
    }

    fn phases(&self) -> &Phases {
        &self.phases
    }

    fn health(&self) -> Health {
        let finite = self.problem.watched().iter().all(|(_, values)| values.iter().all(|value| value.is_finite()));
        Health { finite, max_cfl: 0.0, volume_drift: None, rescued_fits: self.fit_diagnostics.rescued() }
    }

    fn particle_count(&self) -> usize {
        self.cloud.rows
    }

    fn take_findings(&mut self) -> Vec<Finding> {
        std::mem::take(&mut self.findings)
    }
}
