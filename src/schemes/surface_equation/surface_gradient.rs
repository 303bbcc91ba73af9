//! The surface gradient ∇_S f of a known field, and its divergence ∇_S · ∇_S f.

use super::cloud::SurfaceCloud;
use super::method::Wanted;
use super::problem::{Problem, Tools, Watched, watch};
use super::quantities::FIELD;
use crate::geometry::Vector;
use crate::operators::{derivative_tensor, divergence};
use crate::schemes::measured_errors::entry;
use crate::simulation::quantity::quantities;
use crate::simulation::{ErrorEntry, LoadError, Observables, Quantity, Section, StepError};
use crate::time::Clock;
use std::collections::BTreeMap;

quantities! {
    /// Fields that frames show.
    FIELDS {
        GRADIENT = "gradient", "of the field by length", "Computed surface gradient of the field; NaN before the first step.";
        DIVERGENCE = "divergence", "of the field by length^2", "Computed surface divergence of the gradient; NaN before the first step.";
    }
}

/// The field, and its gradient as computed and exactly, where that is known.
#[derive(Debug)]
pub struct SurfaceGradient<const D: usize> {
    field: Vec<f64>,
    reference: Option<Vec<Vector<D>>>,
    gradient: Vec<Vector<D>>,
    divergence: Vec<f64>,
    is_done: bool,
}

impl<const D: usize> SurfaceGradient<D> {
    /// At the start: nothing is computed yet.
    #[must_use]
    pub fn new(field: Vec<f64>, reference: Option<Vec<Vector<D>>>) -> Self {
        let rows = field.len();
        Self { field, reference, gradient: vec![Vector::zeros(); rows], divergence: vec![0.0; rows], is_done: false }
    }
}

/// The fields that frames show, the surface's own excepted.
#[must_use]
pub fn shown_fields() -> Vec<&'static Quantity> {
    std::iter::once(&FIELD).chain(FIELDS.iter().copied()).collect()
}

impl<const D: usize> Problem<D> for SurfaceGradient<D> {
    fn wanted(&self) -> Vec<Wanted> {
        (0..D).map(Wanted::Gradient).collect()
    }

    fn step(&mut self, tools: Tools<'_, D>) -> Result<(), StepError> {
        let Tools { operators, phases, .. } = tools;
        phases.measure("operators/application", || {
            for (axis, operator) in operators.rows.iter().enumerate() {
                operator.apply(&self.field, &mut self.divergence);
                self.gradient.iter_mut().zip(&self.divergence).for_each(|(g, value)| g[axis] = *value);
            }
            let tensors = derivative_tensor(&operators.rows, &self.gradient);
            self.divergence.iter_mut().zip(&tensors).for_each(|(value, tensor)| *value = divergence(tensor));
        });
        self.is_done = true;
        Ok(())
    }

    fn columns(&self) -> Vec<&'static Quantity> {
        vec![&FIELD, &DIVERGENCE]
    }

    fn column(&self, quantity: &Quantity, clock: Clock) -> Vec<f64> {
        if *quantity == FIELD {
            self.field.clone()
        } else if clock.step == 0 {
            vec![f64::NAN; self.field.len()]
        } else {
            self.divergence.clone()
        }
    }

    fn vector_columns(&self) -> Vec<&'static Quantity> {
        vec![&GRADIENT]
    }

    fn vector_column(&self, _quantity: &Quantity, _cloud: &SurfaceCloud<D>) -> Vec<Vector<D>> {
        if self.is_done { self.gradient.clone() } else { vec![Vector::repeat(f64::NAN); self.field.len()] }
    }

    fn watched(&self) -> Watched<'_> {
        watch([("divergence", &self.divergence)])
    }

    fn errors(&self, _cloud: &SurfaceCloud<D>, clock: Clock) -> Vec<ErrorEntry> {
        let Some(reference) = self.reference.as_ref().filter(|_| self.is_done) else { return Vec::new() };
        let (mut off, mut size, mut most) = (0.0, 0.0, 0.0_f64);
        for (found, exact) in self.gradient.iter().zip(reference) {
            let difference = (found - exact).norm();
            off += difference * difference;
            size += exact.norm_squared();
            most = most.max(difference);
        }
        let relative = (off / f64::max(size, f64::MIN_POSITIVE)).sqrt();
        let known = "exact gradient at the points";
        vec![
            entry("gradient", "relative", relative, clock.time, known),
            entry("gradient", "max", most, clock.time, known),
        ]
    }

    fn observables(&self, _cloud: &SurfaceCloud<D>, _clock: Clock) -> Observables {
        Vec::new()
    }

    fn save(&self, section: &mut Section) {
        section.put_count("is_done", u64::from(self.is_done));
        for axis in 0..D {
            let component: Vec<f64> = self.gradient.iter().map(|g| g[axis]).collect();
            section.put_reals(COMPONENTS[axis % 3], &component);
        }
        section.put_reals("divergence", &self.divergence);
    }

    fn load(&mut self, section: &Section) -> Result<(), LoadError> {
        let rows = self.field.len();
        let is_done = section.count("is_done")? > 0;
        let mut gradient = self.gradient.clone();
        for axis in 0..D {
            let component = section.reals_of(COMPONENTS[axis % 3], rows)?;
            gradient.iter_mut().zip(component).for_each(|(g, value)| g[axis] = *value);
        }
        self.divergence.copy_from_slice(section.reals_of("divergence", rows)?);
        (self.gradient, self.is_done) = (gradient, is_done);
        Ok(())
    }

    fn translate_format_1(&self, _arrays: &Section) -> Result<Section, LoadError> {
        // Format 1 had no such problem.
        Ok(Section::default())
    }

    fn describe(&self, method: &mut BTreeMap<&'static str, String>) {
        method.insert("divergence", "of the computed gradient, by the same operators".to_owned());
    }
}

/// Names of the components of the gradient in a state.
const COMPONENTS: [&str; 3] = ["gradient_x", "gradient_y", "gradient_z"];
