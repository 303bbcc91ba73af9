//! Δ_S applied to a known field, again and again for its time: the error against the exact one, where that is known.

use super::cloud::SurfaceCloud;
use super::format_1;
use super::method::Wanted;
use super::problem::{Problem, Tools, Watched, watch};
use super::quantities::{ERROR_MAX, ERROR_RELATIVE, FIELD, REFERENCE, VALUE};
use crate::schemes::measured_errors::against_exact;
use crate::simulation::{ErrorEntry, LoadError, Observables, Quantity, Section, StepError};
use crate::time::Clock;
use std::collections::BTreeMap;

/// The field, Δ_S of it exactly where that is known, and as computed.
#[derive(Debug)]
pub struct Pointwise {
    field: Vec<f64>,
    reference: Option<Vec<f64>>,
    value: Vec<f64>,
}

impl Pointwise {
    /// The fields that frames show, the surface's own excepted.
    #[must_use]
    pub fn shown_fields(has_reference: bool) -> Vec<&'static Quantity> {
        if has_reference { vec![&VALUE, &FIELD, &REFERENCE] } else { vec![&VALUE, &FIELD] }
    }

    /// At the start: nothing is computed yet.
    #[must_use]
    pub fn new(field: Vec<f64>, reference: Option<Vec<f64>>) -> Self {
        let value = vec![0.0; field.len()];
        Self { field, reference, value }
    }
}

impl<const D: usize> Problem<D> for Pointwise {
    fn wanted(&self) -> Vec<Wanted> {
        vec![Wanted::LaplaceBeltrami]
    }

    fn step(&mut self, tools: Tools<'_, D>) -> Result<(), StepError> {
        let operator = &tools.operators.rows[0];
        tools.phases.measure("operators/application", || operator.apply(&self.field, &mut self.value));
        Ok(())
    }

    fn columns(&self) -> Vec<&'static Quantity> {
        Self::shown_fields(self.reference.is_some())
    }

    fn column(&self, quantity: &Quantity, clock: Clock) -> Vec<f64> {
        if *quantity == FIELD {
            self.field.clone()
        } else if *quantity == REFERENCE {
            self.reference.clone().unwrap_or_default()
        } else if clock.step == 0 {
            // Nothing is computed before the first step.
            vec![f64::NAN; self.value.len()]
        } else {
            self.value.clone()
        }
    }

    fn watched(&self) -> Watched<'_> {
        watch([("value", &self.value)])
    }

    fn errors(&self, _cloud: &SurfaceCloud<D>, clock: Clock) -> Vec<ErrorEntry> {
        match &self.reference {
            Some(reference) if clock.step > 0 => {
                against_exact("value", &self.value, reference, clock.time, "exact operator at the points")
            }
            _ => Vec::new(),
        }
    }

    fn observables(&self, cloud: &SurfaceCloud<D>, clock: Clock) -> Observables {
        if self.reference.is_none() {
            return Vec::new();
        }
        let errors = Problem::<D>::errors(self, cloud, clock);
        let of = |norm: &str| errors.iter().find(|e| e.norm == norm).map_or(f64::NAN, |e| e.value);
        vec![(&ERROR_RELATIVE, of("relative")), (&ERROR_MAX, of("max"))]
    }

    fn save(&self, section: &mut Section) {
        section.put_reals("value", &self.value);
    }

    fn load(&mut self, section: &Section) -> Result<(), LoadError> {
        let value = section.reals_of("value", self.value.len())?;
        self.value.copy_from_slice(value);
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        format_1::pointwise(arrays)
    }

    fn describe(&self, _method: &mut BTreeMap<&'static str, String>) {}
}
