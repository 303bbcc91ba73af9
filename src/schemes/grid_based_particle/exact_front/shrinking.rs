//! Exact motion of a ball by its mean curvature.

use super::ExactFrontMotion;
use crate::geometry::surfaces::Ball;

/// A circle or a sphere that shrinks by its mean curvature: r² = R² − 2 (D − 1) t.
#[derive(Debug, Clone, PartialEq)]
pub struct ShrinkingBall<const D: usize> {
    /// The ball at time 0.
    pub start: Ball<D>,
}

impl<const D: usize> ExactFrontMotion<D> for ShrinkingBall<D> {
    fn ball(&self, _start: &Ball<D>, time: f64) -> Option<Ball<D>> {
        let start = &self.start;
        let square = start.radius * start.radius - 2.0 * (D as f64 - 1.0) * time;
        (square > 0.0).then(|| Ball { center: start.center, radius: square.sqrt() })
    }

    fn extinction(&self, _start: Option<&Ball<D>>) -> Option<f64> {
        Some(self.start.radius * self.start.radius / (2.0 * (D as f64 - 1.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::{Ball, ExactFrontMotion, ShrinkingBall};
    use crate::geometry::Vector;

    #[test]
    fn the_radius_obeys_the_law_and_ends_at_extinction() {
        let start = Ball { center: Vector::<3>::zeros(), radius: 0.4 };
        let motion = ShrinkingBall { start: start.clone() };
        let end = motion.extinction(None).unwrap();
        assert!((end - 0.04).abs() < 1e-15);
        let radius = |time: f64| motion.ball(&start, time).unwrap().radius;
        // dr/dt = −κ = −2/r.
        let (time, e) = (0.02, 1e-6);
        let rate = (radius(time + e) - radius(time - e)) / (2.0 * e);
        assert!((rate + 2.0 / radius(time)).abs() < 1e-6);
        assert!(motion.ball(&start, 1.01 * end).is_none());
    }
}
