//! An operator applied once to a known field: construction and application measured apart, the error against the exact one.

use super::fields::ExactField;
use crate::geometry::Vector;
use crate::operators::{Soundness, StencilOperator, Support, SurfaceDcpse};
use crate::parallel::Interrupt;
use crate::schemes::measured_errors::{ErrorNorms, entry};
use crate::simulation::report::Newton;
use crate::simulation::state::check_length;
use crate::simulation::{
    CpuClock, ErrorEntry, Fields, Finding, Health, Observables, Phases, Report, RestoreError, Simulation, State,
    StepError,
};
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

/// Points of a surface with what is known there exactly.
#[derive(Debug, Clone, Default)]
pub struct SurfacePoints {
    /// Points.
    pub points: Vec<Vector<3>>,
    /// Unit normals.
    pub normals: Vec<Vector<3>>,
    /// ∇·n.
    pub curvatures: Vec<f64>,
}

/// What is asked for.
#[derive(Debug, Clone, Copy)]
pub struct PointwiseParts {
    /// The field.
    pub field: ExactField,
    /// Degree and support of the fits.
    pub support: Support,
    /// How often the operator is applied, for its time.
    pub repeats: u64,
}

/// One step an application; the first constructs the operator.
pub struct PointwiseOperator {
    surface: SurfacePoints,
    parts: PointwiseParts,
    field: Vec<f64>,
    reference: Vec<f64>,
    value: Vec<f64>,
    operator: Option<StencilOperator>,
    soundness: Soundness,
    fixed: FixedStep,
    step: u64,
    interrupt: Interrupt,
    phases: Phases,
}

impl PointwiseOperator {
    /// At the start: nothing is computed yet.
    #[must_use]
    pub fn new(surface: SurfacePoints, parts: PointwiseParts, interrupt: Interrupt, cpu_clock: CpuClock) -> Self {
        let field = surface.points.iter().map(|x| parts.field.value(x)).collect();
        let known = surface.points.iter().zip(&surface.normals).zip(&surface.curvatures);
        let reference = known.map(|((x, n), curvature)| parts.field.laplace_beltrami(x, n, *curvature)).collect();
        let value = vec![0.0; surface.points.len()];
        let fixed = FixedStep { time_step: 1.0, steps: parts.repeats };
        let soundness = Soundness { least_pivot: 1.0, ..Soundness::default() };
        let phases = Phases::new(cpu_clock);
        Self { surface, parts, field, reference, value, operator: None, soundness, fixed, step: 0, interrupt, phases }
    }

    fn errors(&self) -> Vec<ErrorEntry> {
        if self.step == 0 {
            return Vec::new();
        }
        let (mut errors, mut exact) = (ErrorNorms::default(), ErrorNorms::default());
        for (value, reference) in self.value.iter().zip(&self.reference) {
            errors.add(value - reference);
            exact.add(*reference);
        }
        let found = [
            ("relative", errors.rms() / exact.rms()),
            ("max", errors.max()),
            ("max_relative", errors.max() / exact.max()),
        ];
        let time = self.clock().time;
        found.map(|(norm, value)| entry("value", norm, value, time, "exact operator at the points")).to_vec()
    }
}

impl Simulation for PointwiseOperator {
    fn clock(&self) -> Clock {
        self.fixed.clock(self.step)
    }

    fn end(&self) -> Clock {
        self.fixed.clock(self.fixed.steps)
    }

    fn step(&mut self) -> Result<(), StepError> {
        let Self { surface, parts, operator, phases, interrupt, soundness, .. } = self;
        if operator.is_none() {
            let points = SurfaceDcpse { points: &surface.points, normals: &surface.normals };
            let (built, found) =
                phases.measure("operators/construction", || points.laplace_beltrami(parts.support, interrupt))?;
            *operator = Some(built);
            *soundness = found;
        }
        if let Some(operator) = operator {
            phases.measure("operators/application", || operator.apply(&self.field, &mut self.value));
        }
        if let Some(particle) = self.value.iter().position(|value| !value.is_finite()) {
            let Clock { step, time } = self.fixed.clock(self.step + 1);
            return Err(StepError::NonFinite { field: "value", particle, step, time });
        }
        self.step += 1;
        Ok(())
    }

    fn observables(&self) -> Observables {
        let errors = self.errors();
        let of = |norm: &str| errors.iter().find(|e| e.norm == norm).map_or(f64::NAN, |e| e.value);
        let entries = self.operator.as_ref().map_or(f64::NAN, |o| o.entries() as f64 / o.rows().max(1) as f64);
        vec![
            ("time", self.clock().time),
            ("error_relative", of("relative")),
            ("error_max", of("max")),
            ("entries_a_row", entries),
        ]
    }

    fn fields(&self) -> Fields {
        let mut fields = Fields::at(&self.surface.points);
        fields.scalar("field", self.field.clone());
        // Nothing is computed before the first step.
        let value = if self.step == 0 { vec![f64::NAN; self.value.len()] } else { self.value.clone() };
        fields.scalar("value", value);
        fields.scalar("reference", self.reference.clone());
        fields.vector("normal", self.surface.normals.iter().copied());
        fields.scalar("curvature", self.surface.curvatures.clone());
        fields.id("particle_id", (0..self.surface.points.len() as u64).collect());
        fields
    }

    fn state(&self) -> State {
        let Clock { step, time } = self.clock();
        let mut state = State { step, time, ..State::default() };
        state.push_reals("value", &self.value);
        state.push_counts("soundness", vec![self.soundness.enlarged]);
        state.push_reals("least_pivot", &[self.soundness.least_pivot]);
        state
    }

    fn restore(&mut self, state: &State) -> Result<(), RestoreError> {
        if state.step > self.fixed.steps {
            return Err(RestoreError::Beyond { step: state.step, last: self.fixed.steps });
        }
        let (value, counts, pivot) = (state.reals("value")?, state.counts("soundness")?, state.reals("least_pivot")?);
        check_length("value", value.len(), self.value.len())?;
        check_length("soundness", counts.len(), 1)?;
        check_length("least_pivot", pivot.len(), 1)?;
        self.value.copy_from_slice(value);
        self.soundness = Soundness { enlarged: counts[0], failed: 0, least_pivot: pivot[0] };
        // It is a function of the points alone; the next step makes it again.
        self.operator = None;
        self.step = state.step;
        Ok(())
    }

    fn report(&self) -> Report {
        let Support { degree, radius } = self.parts.support;
        let rescued_fits =
            [("supports.larger_radius", self.soundness.enlarged), ("rows.failed", self.soundness.failed)];
        Report {
            errors: self.errors(),
            health: self.health(),
            worst_condition: 1.0 / self.soundness.least_pivot,
            rescued_fits: rescued_fits.into_iter().filter(|(_, count)| *count > 0).collect(),
            newton: Newton::default(),
            method: BTreeMap::from([("operator", format!("degree {degree}, support {radius:.6}"))]),
        }
    }

    fn phases(&self) -> &Phases {
        &self.phases
    }

    fn health(&self) -> Health {
        let finite = self.step == 0 || self.value.iter().all(|value| value.is_finite());
        Health { finite, max_cfl: 0.0, volume_drift: None, rescued_fits: self.soundness.enlarged }
    }

    fn particle_count(&self) -> usize {
        self.surface.points.len()
    }

    fn take_findings(&mut self) -> Vec<Finding> {
        Vec::new()
    }
}
