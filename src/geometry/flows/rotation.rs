//! Rigid rotation about a point, in the x–y plane.

use super::{Flow, Vector};
use std::f64::consts::PI;

/// The flow u = ω e_z × (x − c). In 3D, points keep their z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation<const D: usize> {
    /// Center c of the rotation.
    pub center: Vector<D>,
    /// Angular velocity ω (rad per time), counter-clockwise.
    pub angular_velocity: f64,
}

impl<const D: usize> Flow<D> for Rotation<D> {
    fn velocity(&self, x: &Vector<D>, _time: f64) -> Vector<D> {
        let mut u = Vector::<D>::zeros();
        u[0] = -self.angular_velocity * (x[1] - self.center[1]);
        u[1] = self.angular_velocity * (x[0] - self.center[0]);
        u
    }

    fn keeps_volume(&self, _low: &Vector<D>, _high: &Vector<D>) -> bool {
        true
    }

    fn top_speed(&self, low: &Vector<D>, high: &Vector<D>) -> f64 {
        // The corner of the box that is farthest from the axis; points keep their distance from it.
        let farthest = |d: usize| (low[d] - self.center[d]).abs().max((high[d] - self.center[d]).abs());
        self.angular_velocity.abs() * farthest(0).hypot(farthest(1))
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

#[cfg(test)]
mod tests {
    use super::super::sampling;
    use super::{Flow, PI, Rotation, Vector};

    const FLOW: Rotation<2> = Rotation { center: Vector::<2>::new(0.2, -0.4), angular_velocity: -1.5 };

    #[test]
    fn the_speed_is_that_of_the_farthest_corner() {
        let (low, high) = (Vector::<2>::new(-1.0, -1.0), Vector::<2>::new(0.5, 1.0));
        let (bound, sampled) = (FLOW.top_speed(&low, &high), sampling::top_speed(&FLOW, &low, &high, 3.0));
        assert!(sampled <= bound * 1.01 && sampled >= 0.9 * bound, "{sampled} {bound}");
        assert!((bound - 1.5 * 1.2_f64.hypot(1.4)).abs() < 1e-15);
    }

    #[test]
    fn the_formula_of_paths_has_the_velocity_as_its_derivative() {
        let (x, e) = (Vector::<2>::new(0.7, 0.3), 1e-6);
        let path = |time: f64| FLOW.rigid_path(&x, time).unwrap();
        assert!(((path(e) - path(-e)) / (2.0 * e) - FLOW.velocity(&x, 0.0)).norm() < 1e-9);
        let turn = FLOW.return_time().unwrap();
        assert!((turn - 2.0 * PI / 1.5).abs() < 1e-15 && (path(turn) - x).norm() < 1e-14);
        assert!(FLOW.is_back(2.0 * turn) && !FLOW.is_back(0.5 * turn));
    }
}
