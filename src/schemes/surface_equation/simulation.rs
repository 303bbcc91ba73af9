//! A problem on a surface as a simulation: the first step constructs the operators, every step is the problem's.

use super::cloud::SurfaceCloud;
use super::method::{Form, Method, Operators};
use super::problem::{Problem, Tools};
use crate::linear_algebra::SparseRows;
use crate::operators::{Soundness, Support};
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
    soundness: Soundness,
    fixed: FixedStep,
    step: u64,
    interrupt: Interrupt,
    phases: Phases,
    /// Of points from outside: what they are, for the report.
    origin: Option<String>,
    /// Of points from outside: what is wrong with them, until it was told.
    findings: Vec<Finding>,
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
        let soundness = Soundness::none();
        let phases = Phases::new(cpu_clock);
        let (origin, findings) = (None, Vec::new());
        Self { cloud, method, problem, operators: None, soundness, fixed, step: 0, interrupt, phases, origin, findings }
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

    /// 1. Operators, where there are none yet. 2. The problem's step. 3. A look at the numbers.
    fn step(&mut self) -> Result<(), StepError> {
        let Self { cloud, method, problem, operators, phases, interrupt, soundness, fixed, .. } = self;
        let (from, to) = (fixed.clock(self.step), fixed.clock(self.step + 1));
        let operators = match operators {
            Some(operators) => operators,
            None => {
                let wanted = problem.wanted();
                let build = || method.build::<D, M>(cloud, &wanted, interrupt);
                let built = phases.measure("operators/construction", build)?;
                *soundness = built.soundness;
                operators.insert(built)
            }
        };
        problem.step(Tools { cloud, operators, interrupt, phases, from, to })?;
        interrupt.check()?;
        if let Some(place) = problem.watched().iter().position(|value| !value.is_finite()) {
            let particle = place % cloud.rows.max(1);
            return Err(StepError::NonFinite { field: "value", particle, step: to.step, time: to.time });
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
        state.push_counts(
            "soundness",
            vec![self.soundness.enlarged, self.soundness.low_rank, self.soundness.unresolved],
        );
        state.push_reals("least_pivot", &[self.soundness.least_pivot]);
        state
    }

    fn restore(&mut self, state: &State) -> Result<(), RestoreError> {
        if state.step > self.fixed.steps {
            return Err(RestoreError::Beyond { step: state.step, last: self.fixed.steps });
        }
        let (counts, pivot) = (state.counts("soundness")?, state.reals("least_pivot")?);
        check_length("soundness", counts.len(), 3)?;
        check_length("least_pivot", pivot.len(), 1)?;
        self.problem.load(state)?;
        let (enlarged, low_rank, unresolved) = (counts[0], counts[1], counts[2]);
        self.soundness = Soundness { enlarged, low_rank, unresolved, failed: 0, least_pivot: pivot[0] };
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
        let Soundness { enlarged, low_rank, unresolved, failed, least_pivot } = self.soundness;
        let rescued = [
            ("supports.larger_radius", enlarged),
            ("supports.low_rank", low_rank),
            ("supports.unresolved", unresolved),
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
            worst_condition: 1.0 / least_pivot,
            rescued_fits: rescued.into_iter().filter(|(_, count)| *count > 0).collect(),
            newton: Newton::default(),
            method,
        }
    }

    fn phases(&self) -> &Phases {
        &self.phases
    }

    fn health(&self) -> Health {
        let finite = self.problem.watched().iter().all(|value| value.is_finite());
        let rescued_fits = self.soundness.enlarged + self.soundness.low_rank + self.soundness.unresolved;
        Health { finite, max_cfl: 0.0, volume_drift: None, rescued_fits }
    }

    fn particle_count(&self) -> usize {
        self.cloud.rows
    }

    fn take_findings(&mut self) -> Vec<Finding> {
        std::mem::take(&mut self.findings)
    }
}
