//! Diffusivities: numbers, formulas of the place, and data.

use super::field_choices::{Course, Site};
use super::field_spec::FieldValue;
use super::field_values::values;
use crate::formulas::NamedNumbers;
use crate::geometry::Vector;
use crate::schemes::surface_equation::{Diffusivity, ExactField, SurfaceCloud};
use crate::spec::Violation;
use serde_json::json;

/// How fast a substance diffuses.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Spread {
    /// As fast everywhere.
    Uniform(f64),
    /// By the place.
    Field(ExactField),
}

/// The diffusivity that stands at a site.
pub(super) fn spread(
    site: Site,
    value: &FieldValue,
    owner: (&str, &NamedNumbers),
    errors: &mut Vec<Violation>,
) -> Spread {
    let Some(number) = value.number() else { return Spread::Field(site.value(value, owner, Course::AtRest, errors)) };
    if number < 0.0 {
        let detail = "a diffusivity is not negative";
        errors.push(Violation::new(site.pointer, "range", detail, number, json!({"least": 0})));
    }
    Spread::Uniform(number)
}

impl Spread {
    /// The largest diffusivity, for estimates: that at places about the origin where it is a formula of the place, and 1 where
    /// nothing is known of it.
    pub fn largest(&self, reach: f64) -> f64 {
        match self {
            Self::Uniform(number) => *number,
            Self::Field(ExactField::Formula(field)) if field.is_of_place() => {
                let place = |k: usize| {
                    let side = if k.is_multiple_of(2) { reach } else { -reach };
                    Vector::<3>::from_fn(|d, _| if d == k / 2 { side } else { 0.0 })
                };
                let values = (0..6).map(|k| field.value(&place(k))).filter(|value| value.is_finite());
                values.fold(0.0, f64::max)
            }
            Self::Field(_) => 1.0,
        }
    }
}

/// How fast a substance diffuses at the points of a cloud.
///
/// # Errors
/// One [`Violation`] where a formula has no value, or a diffusivity is negative.
pub(super) fn diffusivity<const D: usize>(
    spread: &Spread,
    cloud: &SurfaceCloud<D>,
    pointer: &str,
) -> Result<Diffusivity, Vec<Violation>> {
    let field = match spread {
        Spread::Uniform(number) => return Ok(Diffusivity::Uniform(*number)),
        Spread::Field(field) => field,
    };
    let values = values(field, cloud, pointer)?;
    match values.iter().position(|value| *value < 0.0) {
        None => Ok(Diffusivity::Varying(values)),
        Some(i) => {
            let place: Vec<f64> = cloud.points[i].iter().copied().collect();
            let detail = format!("the diffusivity is negative at point {i}, {place:?}");
            Err(vec![Violation::new(pointer, "data", detail, values[i], "numbers of 0 or more")])
        }
    }
}
