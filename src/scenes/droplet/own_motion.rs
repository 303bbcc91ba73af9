//! Motion of one's own: velocities at the start and forces from outside that are given by formulas.

use super::room::Room;
use super::spec::{Droplet, ForceChoice, InitialVelocitySpec};
use super::vectors::vector;
use crate::formulas::{Bound, Context, FormulaList, Input, NamedNumbers};
use crate::geometry::Vector;
use crate::geometry::block::indices;
use crate::schemes::weakly_compressible_sph::{BodyForce, FormulaForce};
use crate::spec::{Parameter, Violation};
use serde_json::{Value, json};
use std::sync::Arc;

/// Where the velocity at the start stands.
const POINTER: &str = "/initial_velocity";
/// Places along an axis of the box at which sizes are looked at.
const PLACES: usize = 24;

/// The velocities at the start, by formulas of the place.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StartMotion {
    /// Of the fluid inside, or of each part of a union.
    inside: Vec<Bound>,
    outside: Option<Bound>,
}

const fn places<const D: usize>() -> &'static [&'static str] {
    if D == 2 { &["x", "y"] } else { &["x", "y", "z"] }
}

/// The velocity of the frame, the motion of the fluids in it, and the sizes of gravity and of both.
pub(super) type MotionAtStart<const D: usize> = (Vector<D>, Option<StartMotion>, [f64; 3]);

/// How a scene moves at the start, in a box with a lower corner and lengths; `parts` is the number of its drops.
pub(super) fn motion_at_start<const D: usize>(
    spec: &Droplet,
    parts: Option<usize>,
    room: &Room<D>,
    errors: &mut Vec<Violation>,
) -> MotionAtStart<D> {
    let acceleration = match spec.body_force.as_ref() {
        Some(ForceChoice::Constant { acceleration, .. }) if acceleration.len() == D => {
            Vector::<D>::from_column_slice(acceleration)
        }
        Some(_) | None => Vector::<D>::zeros(),
    };
    let (gravity, driven) = room.driven(spec, &acceleration);
    let velocity = spec.velocity.as_ref().map_or_else(Vector::<D>::zeros, |v| vector::<D>("/velocity", v, errors));
    let motion = start_motion::<D>(spec, parts, errors);
    let own_speed = motion.as_ref().map_or(driven, |motion| driven.max(motion.top_speed(&room.low, &room.lengths())));
    (velocity, motion, [gravity, velocity.norm(), own_speed])
}

/// The velocities of a spec; None where it gives none, or where something is wrong with them.
fn start_motion<const D: usize>(
    spec: &Droplet,
    parts_of_shape: Option<usize>,
    errors: &mut Vec<Violation>,
) -> Option<StartMotion> {
    let InitialVelocitySpec { inside, parts, outside, parameters } = spec.initial_velocity.as_ref()?;
    let before = errors.len();
    let mut bound = |formulas: &FormulaList, name: String| {
        let formulas = match formulas.components::<D>(POINTER, &name) {
            Ok(formulas) => formulas,
            Err(error) => {
                errors.push(error);
                return None;
            }
        };
        let context = Context { pointer: POINTER, variables: places::<D>(), parameters };
        Bound::new(&formulas, context).map_err(|found| errors.extend(found)).ok()
    };
    let outside = outside.as_ref().and_then(|formulas| bound(formulas, "outside".to_owned()));
    let given: Vec<Option<Bound>> = match (inside, parts) {
        (Some(inside), _) => vec![bound(inside, "inside".to_owned())],
        (None, Some(parts)) => parts.0.iter().enumerate().map(|(k, part)| bound(part, format!("parts/{k}"))).collect(),
        (None, None) => Vec::new(),
    };
    if let (Some(_), Some(parts)) = (inside, parts) {
        let detail = "the fluid inside has one velocity, or each part of a union has its own; give one of them";
        errors.push(Violation::new(format!("{POINTER}/parts"), "conflict", detail, parts.to_json(), Value::Null));
    }
    if let (Some(parts), Some(found)) = (parts, parts_of_shape)
        && found != parts.0.len()
    {
        let detail = format!("the shape has {found} parts, and there are velocities of {}", parts.0.len());
        errors.push(Violation::new(format!("{POINTER}/parts"), "conflict", detail, parts.0.len(), json!(found)));
    }
    let inside: Option<Vec<Bound>> = given.into_iter().collect();
    let inside = inside?;
    (errors.len() == before).then_some(StartMotion { inside, outside })
}

impl StartMotion {
    /// The largest speed in a box, so far as formulas are finite there.
    pub fn top_speed<const D: usize>(&self, low: &Vector<D>, lengths: &Vector<D>) -> f64 {
        let lattice = lattice(low, lengths);
        let speeds = |bound: &Bound| largest(&vectors(bound, &lattice, &[]));
        self.inside.iter().chain(&self.outside).map(speeds).fold(0.0, f64::max)
    }

    /// The velocities of particles. `levels` are their distances from the drop, and `part` tells in which part of it particle i is.
    ///
    /// # Errors
    /// The first particle where a formula is not finite.
    pub fn at<const D: usize>(
        &self,
        positions: &[Vector<D>],
        levels: &[f64],
        part: impl Fn(usize) -> usize,
    ) -> Result<Vec<Vector<D>>, Violation> {
        let zero = vec![Vector::<D>::zeros(); positions.len()];
        let outside = self.outside.as_ref().map_or_else(|| zero.clone(), |bound| vectors(bound, positions, &[]));
        let inside: Vec<Vec<Vector<D>>> = self.inside.iter().map(|bound| vectors(bound, positions, &[])).collect();
        let mut found = zero;
        for (i, velocity) in found.iter_mut().enumerate() {
            let (chosen, bound) = if levels[i] > 0.0 {
                (Some(&outside), self.outside.as_ref())
            } else {
                let k = if self.inside.len() > 1 { part(i) } else { 0 };
                (inside.get(k), self.inside.get(k))
            };
            let Some(chosen) = chosen else { continue };
            *velocity = chosen[i];
            if chosen[i].iter().any(|component| !component.is_finite()) {
                let at: Vec<f64> = positions[i].iter().copied().collect();
                let fault = bound.and_then(|bound| bound.fault(&at));
                let detail = fault.map_or_else(|| "a velocity is not finite".to_owned(), |fault| fault.to_string());
                return Err(Violation::new(
                    POINTER,
                    "data",
                    format!("{detail}, particle {i}"),
                    Value::Null,
                    Value::Null,
                ));
            }
        }
        Ok(found)
    }
}

/// Places of a lattice in a box.
fn lattice<const D: usize>(low: &Vector<D>, lengths: &Vector<D>) -> Vec<Vector<D>> {
    let place = |k: usize| {
        let cell = indices(k, &[PLACES; D]);
        Vector::<D>::from_fn(|d, _| low[d] + (cell[d] as f64 + 0.5) / PLACES as f64 * lengths[d])
    };
    (0..PLACES.pow(D as u32)).map(place).collect()
}

/// The vectors that formulas have at places; `more` are the inputs beyond the coordinates.
fn vectors<const D: usize>(bound: &Bound, positions: &[Vector<D>], more: &[Input<'_>]) -> Vec<Vector<D>> {
    let columns: Vec<Vec<f64>> = (0..D).map(|d| positions.iter().map(|x| x[d]).collect()).collect();
    let inputs: Vec<Input<'_>> =
        columns.iter().map(|column| Input::Column(column)).chain(more.iter().copied()).collect();
    let values = bound.everywhere(&inputs, positions.len());
    (0..positions.len()).map(|i| Vector::<D>::from_fn(|d, _| values[d][i])).collect()
}

/// The largest size of vectors, those aside that are not finite.
fn largest<const D: usize>(vectors: &[Vector<D>]) -> f64 {
    vectors.iter().map(Vector::<D>::norm).filter(|size| size.is_finite()).fold(0.0, f64::max)
}

/// The body force of formulas in a box until `end_time`.
pub(super) fn formula_force<const D: usize>(
    acceleration: &FormulaList,
    parameters: &NamedNumbers,
    (low, lengths, end_time): (&Vector<D>, &Vector<D>, f64),
    errors: &mut Vec<Violation>,
) -> Option<BodyForce<D>> {
    const POINTER: &str = "/body_force";
    let formulas = acceleration.components::<D>(POINTER, "acceleration").map_err(|error| errors.push(error)).ok()?;
    let variables: Vec<&str> = places::<D>().iter().copied().chain(["inside", "t"]).collect();
    let context = Context { pointer: POINTER, variables: &variables, parameters };
    let bound = Bound::new(&formulas, context).map_err(|found| errors.extend(found)).ok()?;
    let lattice = lattice(low, lengths);
    let mut strength = 0.0_f64;
    for k in 0..=16 {
        let time = f64::from(k) / 16.0 * end_time;
        for inside in [0.0, 1.0] {
            let accelerations = vectors(&bound, &lattice, &[Input::Uniform(inside), Input::Uniform(time)]);
            strength = strength.max(largest(&accelerations));
        }
    }
    Some(BodyForce::Formula(Arc::new(FormulaForce::new(bound, strength))))
}
