//! Geometrical optics: a wave front as a curve in (x, y, θ) (GBPM 4.6).

use super::prescribed_flow::{WIDEST_BRIDGE, carry};
use super::{FrontLaw, MotionStep, MovingFront};
use crate::geometry::flows::Rays;
use crate::geometry::{Flow, Vector};
use crate::schemes::grid_based_particle::foot_points::FootPoints;
use crate::time::integrators::PathError;

/// Rays of geometrical optics in a medium of constant speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeometricalOptics {
    rays: Rays,
}

/// Default CFL number, dt · c/h.
const DEFAULT_CFL: f64 = 2.0;

impl GeometricalOptics {
    /// The law of rays with speed c.
    #[must_use]
    pub fn new(speed: f64) -> Self {
        Self { rays: Rays { speed } }
    }
}

impl FrontLaw<3, 1> for GeometricalOptics {
    fn name(&self) -> &'static str {
        "optics"
    }

    fn velocity(&self, feet: &FootPoints<3>, i: usize, time: f64) -> Vector<3> {
        self.rays.velocity(&feet.positions[i], time)
    }

    fn advance(&self, front: &mut MovingFront<'_, 3>, step: &MotionStep<'_>) -> Result<f64, PathError> {
        carry::<3, 1>(front.feet, &self.rays, step)
    }

    fn flow(&self) -> Option<&dyn Flow<3>> {
        Some(&self.rays)
    }

    fn keeps_particles_exact(&self) -> bool {
        true
    }

    fn lets_segments_meet(&self) -> bool {
        false
    }

    fn widest_bridge(&self) -> f64 {
        WIDEST_BRIDGE
    }

    fn top_speed(&self, _extent: Option<&(Vector<3>, Vector<3>)>) -> f64 {
        self.rays.speed.abs()
    }

    fn default_cfl(&self) -> Option<f64> {
        Some(DEFAULT_CFL)
    }
}
