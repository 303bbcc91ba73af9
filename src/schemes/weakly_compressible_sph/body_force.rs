//! Forces from outside, as accelerations.

use crate::geometry::Vector;
use std::f64::consts::PI;

/// A force from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BodyForce<const D: usize> {
    /// The same everywhere, on both fluids.
    Constant(Vector<D>),
    /// Along x on the inner fluid, until `duration`: F sin(π t/T) sin(π x/A) cos(π y/2B) (cos(π z/2C)) (PCP eqs. 29, 30).
    Pulse {
        /// F.
        coefficient: f64,
        /// T.
        duration: f64,
        /// A, B and (in space) C.
        lengths: Vector<D>,
    },
}

impl<const D: usize> BodyForce<D> {
    /// The acceleration of a particle.
    #[must_use]
    pub fn acceleration(&self, x: &Vector<D>, time: f64, is_inside: bool) -> Vector<D> {
        match self {
            Self::Constant(acceleration) => *acceleration,
            Self::Pulse { coefficient, duration, lengths } => {
                let mut acceleration = Vector::<D>::zeros();
                if is_inside && time < *duration {
                    let across: f64 = (1..D).map(|d| (0.5 * PI * x[d] / lengths[d]).cos()).product();
                    let along = (PI * x[0] / lengths[0]).sin();
                    acceleration[0] = coefficient * (PI * time / duration).sin() * along * across;
                }
                acceleration
            }
        }
    }

    /// Its largest acceleration.
    #[must_use]
    pub fn strength(&self) -> f64 {
        match self {
            Self::Constant(acceleration) => acceleration.norm(),
            Self::Pulse { coefficient, .. } => coefficient.abs(),
        }
    }
}
