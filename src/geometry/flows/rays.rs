//! Rays of geometrical optics in (x, y, θ), θ the direction of travel.

use super::{Flow, Vector};

/// dx/dt = c cos θ, dy/dt = c sin θ, dθ/dt = 0 (GBPM eq. 23 with a constant speed c).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rays {
    /// c.
    pub speed: f64,
}

impl Flow<3> for Rays {
    fn velocity(&self, x: &Vector<3>, _time: f64) -> Vector<3> {
        Vector::<3>::new(x[2].cos(), x[2].sin(), 0.0) * self.speed
    }

    fn return_time(&self) -> Option<f64> {
        None
    }
}
