//! Uniform motion.

use super::{Flow, Vector};

/// u = v everywhere at all times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Translation<const D: usize> {
    /// v.
    pub velocity: Vector<D>,
}

impl<const D: usize> Flow<D> for Translation<D> {
    fn velocity(&self, _x: &Vector<D>, _time: f64) -> Vector<D> {
        self.velocity
    }

    fn rigid_path(&self, x: &Vector<D>, duration: f64) -> Option<Vector<D>> {
        Some(x + self.velocity * duration)
    }

    fn return_time(&self) -> Option<f64> {
        None
    }
}
