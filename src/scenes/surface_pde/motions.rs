//! The motion of a surface from its choice, and what is known of the field on it.

use super::field_choices::vector_in_space;
use super::surfaces::Shape;
use super::transport_spec::MotionChoice;
use crate::geometry::Vector;
use crate::geometry::flows::{FlowChoice, GridData};
use crate::schemes::surface_equation::{Course, ExactField, Motion, MovingParts};
use crate::spec::{Coordinates, Parameter, Violation};
use serde_json::json;

/// Where the motion stands in the scene.
pub(super) const POINTER: &str = "/problem/motion";

/// A planned motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum MotionPlan {
    /// A flow, and the time at the end.
    Flow(FlowChoice, f64),
    Expansion {
        rate: f64,
        center: Vector<3>,
    },
    Normal {
        speed: f64,
    },
}

/// A place, with as many numbers as the space has dimensions.
pub(super) fn place(numbers: &Coordinates, shape: &Shape, pointer: &str, errors: &mut Vec<Violation>) -> Vector<3> {
    if !shape.is_curve() {
        return vector_in_space(numbers, pointer, errors);
    }
    if numbers.len() != 2 {
        let detail = "a vector in the plane has two numbers";
        errors.push(Violation::new(pointer, "range", detail, numbers.to_json(), 2));
    }
    Vector::<3>::from_fn(|d, _| if d < 2 { numbers.get(d).copied().unwrap_or(f64::NAN) } else { 0.0 })
}

/// The motion of a choice.
pub(super) fn plan(choice: &MotionChoice, shape: &Shape, end_time: f64, errors: &mut Vec<Violation>) -> MotionPlan {
    match choice {
        MotionChoice::Flow(flow) => {
            let refused = if shape.is_curve() {
                flow.flow::<2>(end_time, POINTER, None).err()
            } else {
                flow.flow::<3>(end_time, POINTER, None).err()
            };
            errors.extend(refused.into_iter().flatten());
            MotionPlan::Flow(flow.clone(), end_time)
        }
        MotionChoice::Expansion { rate, center } => {
            let at = "/problem/motion/center";
            let center = center.as_ref().map_or(Vector::<3>::zeros(), |center| place(center, shape, at, errors));
            MotionPlan::Expansion { rate: *rate, center }
        }
        MotionChoice::Normal { speed } => {
            if let Some(radius) = shape.radius().filter(|radius| radius + speed * end_time <= 0.0) {
                let detail = format!("the surface shrinks to a point at time {:.4e}, before the end", radius / -speed);
                let allowed = json!({"above": -radius / end_time});
                errors.push(Violation::new("/problem/motion/speed", "range", detail, *speed, allowed));
            }
            MotionPlan::Normal { speed: *speed }
        }
    }
}

impl MotionPlan {
    /// Whether [`Self::course`] knows the field.
    pub fn has_course(&self, field: &ExactField, diffusivity: f64, shape: &Shape) -> bool {
        self.course(field, diffusivity, shape, Vec::new()).is_some()
    }

    /// An eigenfunction on a circle or a sphere whose radius R(t) alone changes, with values at the start: these times
    /// (R₀/R)^M exp(−λ₀ R₀² d ∫ dt/R²).
    fn course(&self, field: &ExactField, diffusivity: f64, shape: &Shape, values: Vec<f64>) -> Option<Course> {
        let radius = shape.radius()?;
        let decay = diffusivity * field.decay(radius)? * radius * radius;
        let power = if shape.is_curve() { 1 } else { 2 };
        let share: Box<dyn Fn(f64) -> f64 + Send> = match *self {
            Self::Expansion { rate, center } if center == Vector::<3>::zeros() => {
                // ∫ dt/R² = (1 − exp(−2 a t))/(2 a R₀²).
                let integral = move |time: f64| {
                    let whole = if rate == 0.0 { time } else { -(-2.0 * rate * time).exp_m1() / (2.0 * rate) };
                    whole / (radius * radius)
                };
                let share = move |time: f64| (-f64::from(power) * rate * time - decay * integral(time)).exp();
                Box::new(share)
            }
            Self::Normal { speed } => {
                // ∫ dt/R² = t/(R₀ R).
                let share = move |time: f64| {
                    let now = radius + speed * time;
                    (radius / now).powi(power) * (-decay * time / (radius * now)).exp()
                };
                Box::new(share)
            }
            Self::Expansion { .. } | Self::Flow(..) => return None,
        };
        Some(Box::new(move |time| {
            let share = share(time);
            values.iter().map(|value| share * value).collect()
        }))
    }

    /// What a simulation needs.
    ///
    /// # Errors
    /// One [`Violation`] where the flow does not exist in the dimension of the surface.
    pub fn parts<const D: usize>(
        &self,
        field: &ExactField,
        diffusivity: f64,
        shape: &Shape,
        values: &[f64],
        data: Option<GridData<'_>>,
    ) -> Result<MovingParts<D>, Vec<Violation>> {
        let motion = match self {
            Self::Flow(flow, end_time) => Motion::Flow(flow.flow::<D>(*end_time, POINTER, data)?),
            Self::Expansion { rate, center } => {
                Motion::Expansion { rate: *rate, center: Vector::<D>::from_fn(|d, _| center[d]) }
            }
            Self::Normal { speed } => Motion::Normal { speed: *speed },
        };
        let exact = self.course(field, diffusivity, shape, values.to_vec());
        Ok(MovingParts { motion, diffusivity, exact })
    }
}
