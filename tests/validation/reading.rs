//! Reading numbers of runs, and bodies that differ from another in a few fields.

use meniscus::simulation::{Report, Simulation};
use serde_json::Value;

/// A number of the series at the present step.
pub fn observable(simulation: &dyn Simulation, name: &str) -> f64 {
    simulation.observables().iter().find(|(quantity, _)| quantity.name == name).unwrap().1
}

/// An error of a report.
pub fn error(report: &Report, quantity: &str, norm: &str) -> f64 {
    report.errors.iter().find(|entry| entry.quantity == quantity && entry.norm == norm).unwrap().value
}

/// A body with some fields replaced or added.
pub fn with(body: &Value, more: &Value) -> Value {
    let mut body = body.clone();
    body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    body
}
