//! Uniform motion.

use super::{Flow, Vector};

/// The flow u = v, the same everywhere and at all times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Translation<const D: usize> {
    /// Velocity v.
    pub velocity: Vector<D>,
}

impl<const D: usize> Flow<D> for Translation<D> {
    fn velocity(&self, _x: &Vector<D>, _time: f64) -> Vector<D> {
        self.velocity
    }

    fn keeps_volume(&self, _low: &Vector<D>, _high: &Vector<D>) -> bool {
        true
    }

    fn top_speed(&self, _low: &Vector<D>, _high: &Vector<D>) -> f64 {
        self.velocity.iter().map(|v| v * v).sum::<f64>().sqrt()
    }

    fn rigid_path(&self, x: &Vector<D>, duration: f64) -> Option<Vector<D>> {
        Some(x + self.velocity * duration)
    }
}

#[cfg(test)]
mod tests {
    use super::super::sampling;
    use super::{Flow, Translation, Vector};

    #[test]
    fn points_move_along_straight_lines_and_never_return() {
        let flow = Translation { velocity: Vector::<2>::new(3.0, -4.0) };
        let (low, high) = (Vector::<2>::zeros(), Vector::<2>::repeat(1.0));
        assert!((flow.top_speed(&low, &high) - 5.0).abs() < 1e-15);
        assert!((sampling::top_speed(&flow, &low, &high, 1.0) - 5.0).abs() < 1e-12);
        assert_eq!(flow.rigid_path(&Vector::<2>::new(1.0, 1.0), 2.0), Some(Vector::<2>::new(7.0, -7.0)));
        assert!(flow.is_rigid() && !flow.is_back(2.0));
    }
}
