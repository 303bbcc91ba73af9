//! The tangential velocity of a choice, and the exact course of what it carries where that is known.

use super::field_choices::{Site, raised, vector_in_space};
use super::field_spec::FieldChoice;
use super::motions::place;
use super::surfaces::Shape;
use super::transport_spec::VelocityChoice;
use crate::geometry::Vector;
use crate::schemes::surface_equation::{Course, ExactField, SurfaceCloud};
use crate::spec::{Coordinates, Parameter, Violation};
use serde_json::Value;

/// A velocity in space, whose tangential part counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Velocity {
    /// ω × (x − c).
    Rotation {
        omega: Vector<3>,
        center: Vector<3>,
    },
    Uniform(Vector<3>),
    /// n × ∇ψ with ψ = a sin(k·x).
    Stream {
        k: Vector<3>,
        amplitude: f64,
    },
}

/// The velocity of a choice, which gets what was left open.
pub(super) fn plan(choice: &mut VelocityChoice, site: Site, errors: &mut Vec<Violation>) -> Velocity {
    let shape = site.shape;
    let at = |field: &str| format!("/problem/velocity/{field}");
    match choice {
        VelocityChoice::Rotation { axis, center, rate } => {
            let axis = match axis {
                Some(axis) if shape.is_curve() => {
                    let detail = "in the plane a rotation has no axis but a center";
                    errors.push(Violation::new(at("axis"), "conflict", detail, axis.to_json(), Value::Null));
                    Vector::<3>::z()
                }
                Some(axis) => vector_in_space(axis, &at("axis"), errors),
                None => Vector::<3>::z(),
            };
            if axis.norm() == 0.0 {
                let detail = "an axis has a direction";
                errors.push(Violation::new(at("axis"), "range", detail, Value::Null, "a vector that is not zero"));
            }
            let center = center.as_ref().map_or(Vector::<3>::zeros(), |c| place(c, shape, &at("center"), errors));
            Velocity::Rotation { omega: axis.normalize() * *rate, center }
        }
        VelocityChoice::Uniform { velocity } => {
            let along_x = if shape.is_curve() { vec![1.0, 0.0] } else { vec![1.0, 0.0, 0.0] };
            let velocity = velocity.get_or_insert(Coordinates(along_x));
            Velocity::Uniform(place(velocity, shape, &at("velocity"), errors))
        }
        VelocityChoice::Stream { k, amplitude } => {
            if shape.is_curve() {
                let detail = "a curve has no flow across a gradient";
                let velocity = "/problem/velocity";
                errors.push(Violation::new(
                    velocity,
                    "conflict",
                    detail,
                    "stream",
                    serde_json::json!(["rotation", "uniform"]),
                ));
            }
            let mut wave = FieldChoice::PlaneWave { k: k.take() };
            let field = Site { pointer: "/problem/velocity", ..site }.field(&mut wave, errors);
            if let FieldChoice::PlaneWave { k: found } = wave {
                *k = found;
            }
            let k = if let ExactField::PlaneWave { k } = field { k } else { Vector::<3>::zeros() };
            Velocity::Stream { k, amplitude: *amplitude }
        }
    }
}

impl Velocity {
    /// The largest speed within a length of the origin.
    pub fn top_speed(&self, reach: f64) -> f64 {
        match self {
            Self::Rotation { omega, center } => omega.norm() * (reach + center.norm()),
            Self::Uniform(velocity) => velocity.norm(),
            Self::Stream { k, amplitude } => amplitude.abs() * k.norm(),
        }
    }

    /// The tangential velocity at a place with a unit normal.
    pub fn at<const D: usize>(&self, x: &Vector<D>, n: &Vector<D>) -> Vector<D> {
        let (x, normal) = (raised(x), raised(n));
        let v = match self {
            Self::Rotation { omega, center } => omega.cross(&(x - center)),
            Self::Uniform(velocity) => *velocity,
            Self::Stream { k, amplitude } => normal.cross(k) * (amplitude * k.dot(&x).cos()),
        };
        let v = v - normal * normal.dot(&v);
        Vector::<D>::from_fn(|d, _| v[d])
    }

    /// Whether [`Self::course`] knows one.
    pub fn has_course(&self, field: &ExactField, diffusivity: f64, shape: &Shape) -> bool {
        let Self::Rotation { omega, center } = self else { return false };
        let turns = match shape {
            Shape::Torus(_) => omega[0] == 0.0 && omega[1] == 0.0,
            shape => shape.radius().is_some(),
        };
        let has_decay = || shape.radius().is_some_and(|radius| field.decay(radius).is_some());
        turns && *center == Vector::<3>::zeros() && (diffusivity == 0.0 || has_decay())
    }

    /// The course of a field that turns with a surface of revolution and decays if it is an eigenfunction; None where it is not known.
    pub fn course<const D: usize>(
        &self,
        field: &ExactField,
        diffusivity: f64,
        shape: &Shape,
        cloud: &SurfaceCloud<D>,
    ) -> Option<Course> {
        let Self::Rotation { omega, .. } = *self else { return None };
        if !self.has_course(field, diffusivity, shape) {
            return None;
        }
        let decay = diffusivity * shape.radius().and_then(|radius| field.decay(radius)).unwrap_or(0.0);
        let field = field.clone();
        let points: Vec<Vector<3>> = cloud.points[..cloud.rows].iter().map(raised).collect();
        let (axis, rate) = (omega.try_normalize(0.0).unwrap_or_else(Vector::<3>::z), omega.norm());
        Some(Box::new(move |time| {
            // Where the value came from: turned back (Rodrigues).
            let (sine, cosine) = (-rate * time).sin_cos();
            let back = |x: &Vector<3>| x * cosine + axis.cross(x) * sine + axis * (axis.dot(x) * (1.0 - cosine));
            let share = (-decay * time).exp();
            points.iter().map(|x| share * field.value(&back(x))).collect()
        }))
    }
}
