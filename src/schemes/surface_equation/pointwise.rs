//! Δ_S applied to a known field, again and again for its time: the error against the exact one, where that is known.

use super::cloud::SurfaceCloud;
use super::method::Wanted;
use super::problem::{Problem, Tools, Watched};
use crate::schemes::measured_errors::against_exact;
use crate::simulation::state::check_length;
use crate::simulation::{ErrorEntry, Observables, RestoreError, State, StepError};
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

    fn columns(&self, clock: Clock) -> Vec<(&'static str, Vec<f64>)> {
        // Nothing is computed before the first step.
        let value = if clock.step == 0 { vec![f64::NAN; self.value.len()] } else { self.value.clone() };
        let mut columns = vec![("value", value), ("field", self.field.clone())];
        columns.extend(self.reference.iter().map(|reference| ("reference", reference.clone())));
        columns
    }

    fn watched(&self) -> Watched<'_> {
        [("value", &self.value), ("", &[])]
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
        vec![("error_relative", of("relative")), ("error_max", of("max"))]
    }

    fn save(&self, state: &mut State) {
        state.push_reals("value", &self.value);
    }

    fn load(&mut self, state: &State) -> Result<(), RestoreError> {
        let value = state.reals("value")?;
        check_length("value", value.len(), self.value.len())?;
        self.value.copy_from_slice(value);
        Ok(())
    }

    fn describe(&self, _method: &mut BTreeMap<&'static str, String>) {}
}
