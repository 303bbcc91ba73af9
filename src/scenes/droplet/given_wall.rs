//! Walls as parameters.

use super::spec::{WallSpec, WallWord};
use super::vectors::vector;
use crate::geometry::Vector;
use crate::schemes::weakly_compressible_sph::walls::{ContactAngle, Wall};
use crate::spec::Violation;
use serde_json::{Value, json};

/// A wall across an axis.
pub(super) fn wall<const D: usize>(spec: &WallSpec, axis: usize, place: &str, errors: &mut Vec<Violation>) -> Wall<D> {
    let at = format!("{place}/velocity");
    let velocity = spec.velocity.as_ref().map_or_else(Vector::<D>::zeros, |given| vector::<D>(&at, given, errors));
    if velocity[axis] != 0.0 {
        let mut along = velocity;
        along[axis] = 0.0;
        let (got, allowed) = (json!(velocity.as_slice()), json!(along.as_slice()));
        errors.push(Violation::new(at, "range", "a wall moves along itself", got, allowed));
    }
    Wall { velocity, ..wall_at_rest(spec, place, errors) }
}

/// A wall that does not move, whatever its velocity.
pub(super) fn wall_at_rest<const D: usize>(spec: &WallSpec, place: &str, errors: &mut Vec<Violation>) -> Wall<D> {
    let contact = contact(spec, place, errors);
    Wall { velocity: Vector::<D>::zeros(), holds_fluid: spec.slip == WallWord::NoSlip, contact }
}

fn contact(spec: &WallSpec, place: &str, errors: &mut Vec<Violation>) -> ContactAngle {
    /// Without an angle given, neither fluid wets a wall more.
    const NEUTRAL: f64 = 90.0;
    let (receding, advancing) = match (spec.contact_angle, spec.receding_angle, spec.advancing_angle) {
        (angle, None, None) => (angle.unwrap_or(NEUTRAL), angle.unwrap_or(NEUTRAL)),
        (None, Some(receding), Some(advancing)) if receding <= advancing => (receding, advancing),
        (None, Some(receding), Some(advancing)) => {
            let detail = "a contact line recedes below the receding angle and advances above the advancing one, which is the larger";
            let at = format!("{place}/receding_angle");
            errors.push(Violation::new(at, "range", detail, receding, format!("a number ≤ {advancing}")));
            (advancing, advancing)
        }
        (Some(angle), ..) => {
            let detail = "a wall has one contact angle, or a receding and an advancing one";
            errors.push(Violation::new(format!("{place}/contact_angle"), "conflict", detail, angle, Value::Null));
            (angle, angle)
        }
        (None, receding, advancing) => {
            let missing = if receding.is_none() { "receding_angle" } else { "advancing_angle" };
            let detail = "a contact line with hysteresis has a receding and an advancing angle";
            let angle = receding.or(advancing).unwrap_or(NEUTRAL);
            errors.push(Violation::new(format!("{place}/{missing}"), "required", detail, Value::Null, angle));
            (angle, angle)
        }
    };
    ContactAngle { receding: receding.to_radians(), advancing: advancing.to_radians() }
}
