//! Wendland's C² kernel σ (1 − q/2)⁴ (1 + 2q) for q = r/ε < 2 (Wendland 1995; PCP eq. A.6).

use super::SmoothingKernel;
use crate::geometry::Vector;
use std::f64::consts::PI;

/// Wendland's C² kernel with support 2 ε, σ = 7/(4π ε²) in the plane and 21/(16π ε³) in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WendlandC2 {
    /// Smoothing length ε.
    pub smoothing_length: f64,
}

impl<const D: usize> SmoothingKernel<D> for WendlandC2 {
    fn value(&self, dx: &Vector<D>) -> f64 {
        let q = dx.norm() / self.smoothing_length;
        if q >= 2.0 {
            return 0.0;
        }
        let sigma = if D == 2 { 7.0 / (4.0 * PI) } else { 21.0 / (16.0 * PI) };
        sigma / self.smoothing_length.powi(D as i32) * (1.0 - 0.5 * q).powi(4) * (1.0 + 2.0 * q)
    }

    fn support(&self) -> f64 {
        2.0 * self.smoothing_length
    }
}
