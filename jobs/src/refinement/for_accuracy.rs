//! The sweep that finds the spacing for an accuracy: where it begins, and what it compares.

use crate::spec::accuracy::Wanted;
use crate::spec::body::{Allowance, BodyError, JobBody, Sources};
use crate::spec::study::{SweepPoint, point_body};
use meniscus::spec::Json;
use serde_json::{Value, json};

/// Spacings of the first level by the default one, the coarsest first.
const FIRST_SPACINGS: [f64; 6] = [8.0, 5.6, 4.0, 2.8, 2.0, 1.4];

/// The body that the levels share: what was sent, without what belongs to the one job.
#[must_use]
pub fn base_of(spec: &Value) -> Value {
    let mut base = spec.clone();
    if let Some(body) = base.as_object_mut() {
        for name in ["accuracy", "after"] {
            body.shift_remove(name);
        }
    }
    base
}

/// The sweep for a body that asks for an accuracy, over the base of [`base_of`].
///
/// # Errors
/// A failed look-up.
pub fn sweep<S: Sources>(
    body: &JobBody,
    wanted: &Wanted,
    allowance: Allowance,
    sources: &S,
) -> Result<Value, BodyError<S::Error>> {
    let search = Search { body, wanted, base: base_of(&body.spec), allowance, sources };
    let from = search.first_value()?;
    Ok(wanted.sweep(from, &search.open_choices(from)?))
}

/// A search among bodies.
struct Search<'a, S> {
    body: &'a JobBody,
    wanted: &'a Wanted,
    base: Json,
    allowance: Allowance,
    sources: &'a S,
}

/// Pointer of a value of the scene that the body leaves open, and the values that are compared.
type OpenChoice = (&'static str, Vec<Json>);

impl<S: Sources> Search<'_, S> {
    /// The body with some values of the scene, if that is valid.
    fn body_with(&self, values: &[(&str, Json)]) -> Result<Option<JobBody>, BodyError<S::Error>> {
        let values: Vec<(String, Json)> =
            values.iter().map(|(pointer, value)| (format!("/scene{pointer}"), value.clone())).collect();
        let places = vec!["/accuracy".to_owned(); values.len()];
        match point_body(&self.base, &SweepPoint { values, places }, self.allowance, self.sources) {
            Ok(body) => Ok(Some(body)),
            Err(BodyError::Invalid(_)) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The value of the axis at the first level: the coarsest that is valid and of which nothing is doubtful before it runs.
    fn first_value(&self) -> Result<f64, BodyError<S::Error>> {
        let axis = self.wanted.axis;
        let default = Value::pointer(&self.body.resolved.scene, axis).and_then(Value::as_f64).unwrap_or(1.0);
        let value = |coarser: f64| {
            if axis == "/count" { (default / (coarser * coarser)).round() } else { default * coarser }
        };
        for coarser in FIRST_SPACINGS {
            let level = self.body_with(&[(axis, json!(value(coarser)))])?;
            if level.is_some_and(|level| level.scene.warnings().is_empty()) {
                return Ok(value(coarser));
            }
        }
        Ok(value(1.0))
    }

    /// Values of the scene that the body leaves open, with those that are compared: the ones that go with the rest of the scene.
    fn open_choices(&self, from: f64) -> Result<Vec<OpenChoice>, BodyError<S::Error>> {
        let mut open = Vec::new();
        for (pointer, values) in self.body.scene.choices() {
            if Value::pointer(&self.base, &format!("/scene{pointer}")).is_some() {
                continue;
            }
            let mut possible = Vec::new();
            for value in values {
                if self.body_with(&[(self.wanted.axis, json!(from)), (pointer, value.clone())])?.is_some() {
                    possible.push(value);
                }
            }
            if possible.len() > 1 {
                open.push((pointer, possible));
            }
        }
        Ok(open)
    }
}
