//! Δ_S of a known field by the embedding, again and again for its time. The first step makes the band.

use super::band::{Band, Places, inner_half_width};
use crate::geometry::{Surface, Vector};
use crate::parallel::Interrupt;
use crate::schemes::measured_errors::against_exact;
use crate::simulation::report::Newton;
use crate::simulation::state::check_length;
use crate::simulation::{
    CpuClock, ErrorEntry, Fields, Finding, Health, Observables, Phases, Report, RestoreError, Simulation, State,
    StepError,
};
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

/// Choices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmbeddingParts {
    /// 2 or 4.
    pub order: usize,
    /// Of the grid.
    pub spacing: f64,
    /// How often the operator is applied.
    pub repeats: u64,
}

impl EmbeddingParts {
    /// Half the width of the band, in spacings of the grid.
    #[must_use]
    pub fn half_band(order: usize) -> f64 {
        inner_half_width(order) + (order / 2) as f64
    }

    /// Bytes of a band about a surface of an area between two corners: those of the nodes (closest points, places, neighbours, three
    /// fields, and what lists of them take until the band stands; measured: 300), and the index of every cell of the box.
    #[must_use]
    pub fn memory(order: usize, spacing: f64, area: f64, (low, high): (Vector<3>, Vector<3>)) -> f64 {
        let half = Self::half_band(order);
        let nodes = 2.0 * half * area / (spacing * spacing);
        let cells: f64 = (high - low).iter().map(|side| side / spacing + 2.0 * half + 3.0).product();
        300.0 * nodes + 4.0 * cells
    }
}

/// The points of a surface and what is known there.
#[derive(Debug, Clone, Default)]
pub struct SurfaceData {
    /// Points.
    pub points: Vec<Vector<3>>,
    /// Unit normals.
    pub normals: Vec<Vector<3>>,
    /// ∇·n.
    pub curvatures: Vec<f64>,
    /// The field.
    pub field: Vec<f64>,
    /// Δ_S of it.
    pub reference: Vec<f64>,
}

/// A field on a surface, anywhere on it.
pub type FieldOnSurface = Box<dyn Fn(&Vector<3>) -> f64 + Send>;

/// One step an application.
pub struct EmbeddingClosestPoint {
    surface: Box<dyn Surface<3>>,
    field: FieldOnSurface,
    data: SurfaceData,
    parts: EmbeddingParts,
    value: Vec<f64>,
    made: Option<Made>,
    fixed: FixedStep,
    step: u64,
    interrupt: Interrupt,
    phases: Phases,
}

/// What the first step makes.
struct Made {
    band: Band,
    places: Places,
    /// The field at the closest points of the nodes, what extension makes of it, and its Laplacian.
    nodal: Vec<f64>,
    extended: Vec<f64>,
    laplacian: Vec<f64>,
}

impl EmbeddingClosestPoint {
    /// At the start: nothing is computed yet.
    #[must_use]
    pub fn new(
        surface: Box<dyn Surface<3>>,
        field: FieldOnSurface,
        data: SurfaceData,
        parts: EmbeddingParts,
        interrupt: Interrupt,
        cpu_clock: CpuClock,
    ) -> Self {
        let value = vec![0.0; data.points.len()];
        let fixed = FixedStep { time_step: 1.0, steps: parts.repeats };
        let phases = Phases::new(cpu_clock);
        Self { surface, field, data, parts, value, made: None, fixed, step: 0, interrupt, phases }
    }

    fn errors(&self) -> Vec<ErrorEntry> {
        if self.step == 0 {
            return Vec::new();
        }
        let time = self.clock().time;
        against_exact("value", &self.value, &self.data.reference, time, "exact operator at the points")
    }
}

impl Simulation for EmbeddingClosestPoint {
    fn clock(&self) -> Clock {
        self.fixed.clock(self.step)
    }

    fn end(&self) -> Clock {
        self.fixed.clock(self.fixed.steps)
    }

    /// 1. The band, where there is none yet. 2. Extension, differences, evaluation.
    fn step(&mut self) -> Result<(), StepError> {
        let Self { surface, field, data, parts, made, phases, interrupt, .. } = self;
        let made = match made {
            Some(made) => made,
            None => {
                let EmbeddingParts { order, spacing, .. } = *parts;
                let build = || Band::about(surface.as_ref(), spacing, order, interrupt);
                let (band, places) = phases.measure("operators/construction", || {
                    let band = build()?;
                    let places = band.places(&data.points);
                    Ok::<_, StepError>((band, places))
                })?;
                let nodal: Vec<f64> = band.closest.iter().map(field).collect();
                let (extended, laplacian) = (vec![0.0; nodal.len()], vec![0.0; nodal.len()]);
                made.insert(Made { band, places, nodal, extended, laplacian })
            }
        };
        let Made { band, places, nodal, extended, laplacian } = made;
        let value = &mut self.value;
        phases.measure("operators/application", || {
            band.extend(nodal, extended);
            band.laplacian(extended, laplacian);
            band.evaluate(places, laplacian, value);
        });
        interrupt.check()?;
        if let Some(particle) = value.iter().position(|value| !value.is_finite()) {
            let Clock { step, time } = self.fixed.clock(self.step + 1);
            return Err(StepError::NonFinite { field: "value", particle, step, time });
        }
        self.step += 1;
        Ok(())
    }

    fn observables(&self) -> Observables {
        let errors = self.errors();
        let of = |norm: &str| errors.iter().find(|e| e.norm == norm).map_or(f64::NAN, |e| e.value);
        vec![("time", self.clock().time), ("error_relative", of("relative")), ("error_max", of("max"))]
    }

    fn fields(&self) -> Fields {
        let SurfaceData { points, normals, curvatures, field, reference } = &self.data;
        let mut fields = Fields::at(points);
        // Nothing is computed before the first step.
        let value = if self.step == 0 { vec![f64::NAN; self.value.len()] } else { self.value.clone() };
        fields.scalar("value", value);
        fields.scalar("field", field.clone());
        fields.scalar("reference", reference.clone());
        fields.vector("normal", normals.iter().copied());
        fields.scalar("curvature", curvatures.clone());
        fields.id("particle_id", (0..points.len() as u64).collect());
        fields
    }

    fn state(&self) -> State {
        let Clock { step, time } = self.clock();
        let mut state = State { step, time, ..State::default() };
        state.push_reals("value", &self.value);
        state
    }

    fn restore(&mut self, state: &State) -> Result<(), RestoreError> {
        if state.step > self.fixed.steps {
            return Err(RestoreError::Beyond { step: state.step, last: self.fixed.steps });
        }
        let value = state.reals("value")?;
        check_length("value", value.len(), self.value.len())?;
        self.value.copy_from_slice(value);
        self.step = state.step;
        Ok(())
    }

    fn report(&self) -> Report {
        let EmbeddingParts { order, spacing, .. } = self.parts;
        let nodes = self.made.as_ref().map_or(0, |made| made.band.len());
        let operator = format!("closest-point embedding of order {order}, {nodes} nodes {spacing:.6} apart");
        Report {
            errors: self.errors(),
            health: self.health(),
            worst_condition: 1.0,
            rescued_fits: BTreeMap::new(),
            newton: Newton::default(),
            method: BTreeMap::from([("operator", operator)]),
        }
    }

    fn phases(&self) -> &Phases {
        &self.phases
    }

    fn health(&self) -> Health {
        let finite = self.value.iter().all(|value| value.is_finite());
        Health { finite, max_cfl: 0.0, volume_drift: None, rescued_fits: 0 }
    }

    fn particle_count(&self) -> usize {
        self.data.points.len()
    }

    fn take_findings(&mut self) -> Vec<Finding> {
        Vec::new()
    }
}
