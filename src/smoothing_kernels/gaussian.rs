//! The truncated Gaussian σ exp(−q²) for q = r/ε ≤ 3 (PCP eq. A.7).

use super::SmoothingKernel;
use crate::geometry::Vector;
use std::f64::consts::PI;

/// The truncated Gaussian with support 3 ε and σ = π^(−D/2) ε^(−D).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaussian {
    /// Smoothing length ε.
    pub smoothing_length: f64,
}

impl<const D: usize> SmoothingKernel<D> for Gaussian {
    fn value(&self, dx: &Vector<D>) -> f64 {
        let q2 = dx.norm_squared() / (self.smoothing_length * self.smoothing_length);
        if q2 > 9.0 { 0.0 } else { (-q2).exp() / (PI.sqrt() * self.smoothing_length).powi(D as i32) }
    }

    fn support(&self) -> f64 {
        3.0 * self.smoothing_length
    }
}
