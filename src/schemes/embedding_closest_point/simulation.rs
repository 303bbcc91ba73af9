//! Δ_S of a known field by the embedding, again and again for its time. The first step makes the band.

use super::band::{Band, Places, inner_half_width};
use super::format_1;
use super::frame_fields;
use super::quantities::{ERROR_MAX, ERROR_RELATIVE, TIME};
use super::surface_data::SurfaceData;
use crate::geometry::{Surface, Vector};
use crate::parallel::Interrupt;
use crate::schemes::measured_errors::against_exact;
use crate::simulation::course::check_finite;
use crate::simulation::{
    Course, CpuClock, Diagnostic, ErrorEntry, Fields, Health, LoadError, Observables, Phases, Report, Section,
    Selection, Simulation, StepError,
};
use crate::time::FixedStep;
use std::collections::BTreeMap;

/// Parameters of the method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmbeddingParts {
    /// Order: 2 or 4.
    pub order: usize,
    /// Spacing of the grid.
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

    /// Bytes of a band about a surface of an area between two corners: those of the nodes (closest points, places, neighbors, three
    /// fields, and what lists of them take until the band stands; measured: 300), and the index of every cell of the box.
    #[must_use]
    pub fn memory(order: usize, spacing: f64, area: f64, (low, high): (Vector<3>, Vector<3>)) -> f64 {
        let half = Self::half_band(order);
        let nodes = 2.0 * half * area / (spacing * spacing);
        let cells: f64 = (high - low).iter().map(|side| side / spacing + 2.0 * half + 3.0).product();
        300.0 * nodes + 4.0 * cells
    }
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
    interrupt: Interrupt,
    course: Course,
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
        let course = Course::new(fixed.into(), Phases::new(cpu_clock), BTreeMap::new());
        Self { surface, field, data, parts, value, made: None, interrupt, course }
    }

    fn errors(&self) -> Vec<ErrorEntry> {
        if self.course.step == 0 {
            return Vec::new();
        }
        let time = self.clock().time;
        against_exact("value", &self.value, &self.data.reference, time, "exact operator at the points")
    }
}

impl Simulation for EmbeddingClosestPoint {
    fn course(&self) -> &Course {
        &self.course
    }

    fn course_mut(&mut self) -> &mut Course {
        &mut self.course
    }

    /// 1. The band, where there is none yet. 2. Extension, differences, evaluation.
    fn advance(&mut self) -> Result<(), StepError> {
        let Self { surface, field, data, parts, made, course, interrupt, .. } = self;
        let (to, phases) = (course.next(), &mut course.phases);
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
        check_finite("value", value, to)?;
        self.course.step += 1;
        Ok(())
    }

    fn observables(&self) -> Observables {
        let errors = self.errors();
        let of = |norm: &str| errors.iter().find(|e| e.norm == norm).map_or(f64::NAN, |e| e.value);
        vec![(&TIME, self.clock().time), (&ERROR_RELATIVE, of("relative")), (&ERROR_MAX, of("max"))]
    }

    fn fields<'a>(&self, selection: Selection<'a>) -> Fields<'a> {
        // Nothing is computed before the first step.
        let value = (self.course.step > 0).then_some(self.value.as_slice());
        frame_fields::frame(&self.data, value, selection)
    }

    fn save(&self, state: &mut Section) {
        self.course.save(state);
        state.put_reals("value", &self.value);
    }

    fn load(&mut self, state: &Section) -> Result<(), LoadError> {
        let clock = self.course.check(state)?;
        let value = state.reals_of("value", self.value.len())?;
        self.value.copy_from_slice(value);
        self.course.step = clock.step;
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        format_1::translate(arrays)
    }

    fn report(&self) -> Report {
        let EmbeddingParts { order, spacing, .. } = self.parts;
        let nodes = self.made.as_ref().map_or(0, |made| made.band.len());
        let operator = format!("closest-point embedding of order {order}, {nodes} nodes {spacing:.6} apart");
        Report {
            errors: self.errors(),
            health: self.health(),
            diagnostics: vec![Diagnostic::count("band.nodes", nodes as u64, "Nodes of the grid near the surface.")],
            method: BTreeMap::from([("operator", operator)]),
        }
    }

    fn health(&self) -> Health {
        let finite = self.value.iter().all(|value| value.is_finite());
        Health { finite, max_cfl: 0.0, volume_drift: None, checks: Vec::new() }
    }

    fn particle_count(&self) -> usize {
        self.data.points.len()
    }
}
