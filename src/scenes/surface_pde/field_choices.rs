//! The exact field of a choice of fields, and what belongs to which surface.

use super::field_spec::{AxisWord, FieldChoice, FieldValue, InitialChoice, OwnField};
use super::surfaces::Shape;
use crate::formulas::{FormulaText, NamedNumbers};
use crate::geometry::Vector;
use crate::schemes::surface_equation::{ExactField, FormulaField};
use crate::spec::{Coordinates, Parameter, Violation};
use serde_json::{Value, json};
use std::sync::Arc;

/// Wave vector that is not given, by the extent of the surface.
const DEFAULT_WAVE: [f64; 3] = [2.0, -1.0, 3.0];
/// Wave numbers, by the extent of the surface, for which a wave has a length that numbers can tell.
const WAVE_SIZES: std::ops::Range<f64> = 1e-6..1e6;

/// A vector of three numbers; NaN where there are fewer, with an error.
pub(super) fn vector_in_space(numbers: &Coordinates, pointer: &str, errors: &mut Vec<Violation>) -> Vector<3> {
    if numbers.len() != 3 {
        let detail = "a vector in space has three numbers";
        errors.push(Violation::new(pointer, "range", detail, numbers.to_json(), 3));
    }
    Vector::<3>::from_fn(|d, _| numbers.get(d).copied().unwrap_or(f64::NAN))
}

fn is_sphere(shape: &Shape) -> bool {
    !shape.is_curve() && shape.radius().is_some()
}

/// The field that is taken where none is given: an eigenfunction where the surface has known ones.
pub(super) fn default_field(shape: &Shape) -> FieldChoice {
    match shape {
        Shape::Circle { .. } => FieldChoice::SinPlusCos { m: 1 },
        shape if is_sphere(shape) => FieldChoice::SphericalHarmonic { l: 4, m: 0.0, axis: AxisWord::Z },
        _ => FieldChoice::PlaneWave { k: None },
    }
}

/// A point in space, z = 0 in the plane.
pub(super) fn raised<const D: usize>(x: &Vector<D>) -> Vector<3> {
    Vector::<3>::from_fn(|d, _| if d < D { x[d] } else { 0.0 })
}

/// Whether a formula may name the time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Course {
    AtRest,
    InTime,
}

/// Where a field stands, and on what.
#[derive(Clone, Copy)]
pub(super) struct Site<'a> {
    pub pointer: &'static str,
    pub shape: &'a Shape,
    /// Number of points.
    pub count: u64,
}

impl Site<'_> {
    /// The exact field of a choice, which gets what was left open.
    pub fn field(self, chosen: &mut FieldChoice, errors: &mut Vec<Violation>) -> ExactField {
        let written = chosen.to_json();
        let belongs = |is_there: bool, detail: &str, errors: &mut Vec<Violation>| {
            if !is_there {
                errors.push(Violation::new(self.pointer, "conflict", detail, written, json!(["plane_wave"])));
            }
        };
        match chosen {
            FieldChoice::SphericalHarmonic { l, m, axis } => {
                belongs(is_sphere(self.shape), "spherical harmonics belong to a sphere", errors);
                if m.abs() > f64::from(*l) || m.fract() != 0.0 {
                    let detail = format!("the order is a whole number from −{l} to {l}");
                    let (at, allowed) = (format!("{}/m", self.pointer), json!([-f64::from(*l), l]));
                    errors.push(Violation::new(at, "range", detail, *m, allowed));
                }
                ExactField::SphericalHarmonic { l: *l, m: *m as i32, axis: *axis as usize }
            }
            FieldChoice::SinPlusCos { m } => {
                let is_circle = matches!(self.shape, Shape::Circle { .. });
                belongs(is_circle, "sin mθ + cos mθ belongs to a circle", errors);
                if *m > self.count / 2 {
                    let detail = format!("a wave needs two points at least, and there are {}", self.count);
                    let (at, allowed) = (format!("{}/m", self.pointer), json!({"most": self.count / 2}));
                    errors.push(Violation::new(at, "range", detail, *m, allowed));
                }
                ExactField::SinPlusCos { m: *m as u32 }
            }
            FieldChoice::PlaneWave { k } => ExactField::PlaneWave { k: self.wave_vector(k, errors) },
            FieldChoice::Own(field) => self.own(field, Course::AtRest, errors),
        }
    }

    /// A field of one's own.
    fn own(self, field: &OwnField, course: Course, errors: &mut Vec<Violation>) -> ExactField {
        match field {
            OwnField::Formula { value, parameters } => self.formula(value, (self.pointer, parameters), course, errors),
            OwnField::Data { .. } => ExactField::Data(self.pointer),
        }
    }

    /// A number, a formula or data. `owner` is the object around the value, whose `parameters` its formulas call by name.
    pub fn value(
        self,
        value: &FieldValue,
        owner: (&str, &NamedNumbers),
        course: Course,
        errors: &mut Vec<Violation>,
    ) -> ExactField {
        match value {
            FieldValue::Text(text) => self.formula(text, owner, course, errors),
            FieldValue::Own(field) => self.own(field, course, errors),
        }
    }

    fn formula(
        self,
        text: &FormulaText,
        (owner, parameters): (&str, &NamedNumbers),
        course: Course,
        errors: &mut Vec<Violation>,
    ) -> ExactField {
        // A field that says more has its formula in a member.
        let place = self.pointer.strip_prefix(owner).filter(|rest| !rest.is_empty());
        let place = place.map_or("value", |rest| rest.trim_start_matches('/'));
        let field = match course {
            Course::AtRest => FormulaField::at_rest(text, parameters, owner, place),
            Course::InTime => FormulaField::in_time(text, parameters, owner, place),
        };
        match field {
            Ok(field) => ExactField::Formula(Arc::new(field)),
            Err(found) => {
                errors.extend(found);
                ExactField::PlaneWave { k: Vector::<3>::from(DEFAULT_WAVE) }
            }
        }
    }

    /// The wave vector; one that is not given is set by the extent of the surface, where it is known.
    fn wave_vector(self, given: &mut Option<Coordinates>, errors: &mut Vec<Violation>) -> Vector<3> {
        let shape = self.shape;
        // Before points are read their extent is not known.
        let is_sized = !matches!(shape, Shape::Points(extent) if !extent.is_known);
        if given.is_none() && is_sized {
            let wave = DEFAULT_WAVE.iter().take(shape.dimension()).map(|k| k / shape.reach());
            *given = Some(Coordinates(wave.collect()));
        }
        let Some(numbers) = given else { return Vector::<3>::from(DEFAULT_WAVE) };
        let at = format!("{}/k", self.pointer);
        let k = if shape.is_curve() {
            if numbers.len() != 2 {
                let detail = "a vector in the plane has two numbers";
                errors.push(Violation::new(at.clone(), "range", detail, numbers.to_json(), 2));
            }
            Vector::<3>::from_fn(|d, _| if d < 2 { numbers.get(d).copied().unwrap_or(f64::NAN) } else { 0.0 })
        } else {
            vector_in_space(numbers, &at, errors)
        };
        let size = k.norm() * shape.reach();
        if is_sized && !size.is_nan() && !WAVE_SIZES.contains(&size) {
            let detail = "the wave length is too small or too large beside the surface";
            errors.push(Violation::new(at, "range", detail, numbers.to_json(), Value::Null));
        }
        k
    }

    /// The exact field of a choice of fields at the start.
    pub fn initial(self, chosen: &mut InitialChoice, errors: &mut Vec<Violation>) -> ExactField {
        match chosen {
            InitialChoice::Field(field) => self.field(field, errors),
            InitialChoice::TruncatedGaussian { center, sigma } => {
                let center = vector_in_space(center, &format!("{}/center", self.pointer), errors);
                ExactField::TruncatedGaussian { center, sigma: *sigma }
            }
        }
    }
}
