//! Vectors of a scene from lists of numbers.

use crate::geometry::Vector;
use crate::spec::{Coordinates, Parameter, Violation};

/// The numbers of a field as a vector.
pub(super) fn vector<const D: usize>(at: &str, numbers: &Coordinates, errors: &mut Vec<Violation>) -> Vector<D> {
    if numbers.len() != D {
        let detail = format!("the scene has {D} dimensions");
        errors.push(Violation::new(at, "conflict", detail, numbers.to_json(), format!("{D} numbers")));
    }
    Vector::<D>::from_fn(|d, _| numbers.get(d).copied().unwrap_or(0.0))
}
