//! Rigid rotation about a point, in the x–y plane.

use super::{Flow, Vector};
use std::f64::consts::PI;

/// u = ω e_z × (x − c); points keep their z in 3D.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation<const D: usize> {
    /// c.
    pub center: Vector<D>,
    /// ω, counter-clockwise.
    pub angular_velocity: f64,
}

impl<const D: usize> Flow<D> for Rotation<D> {
    fn velocity(&self, x: &Vector<D>, _time: f64) -> Vector<D> {
        let mut u = Vector::<D>::zeros();
        u[0] = -self.angular_velocity * (x[1] - self.center[1]);
        u[1] = self.angular_velocity * (x[0] - self.center[0]);
        u
    }

    fn rigid_path(&self, x: &Vector<D>, duration: f64) -> Option<Vector<D>> {
        let (sin, cos) = (self.angular_velocity * duration).sin_cos();
        let (dx, dy) = (x[0] - self.center[0], x[1] - self.center[1]);
        let mut end = *x;
        end[0] = self.center[0] + cos * dx - sin * dy;
        end[1] = self.center[1] + sin * dx + cos * dy;
        Some(end)
    }

    fn return_time(&self) -> Option<f64> {
        (self.angular_velocity != 0.0).then(|| 2.0 * PI / self.angular_velocity.abs())
    }
}
