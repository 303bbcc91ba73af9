//! Smoothing kernels, one file per kernel.
//!
//! A [`SmoothingKernel`] spreads particle values over space. A [`RadialKernel`] is a function of the scaled distance q
//! = r/ε for sums over pairs of particles, in one lane or several.

pub mod gaussian;
pub mod lambda44;
pub mod radial;
pub mod wendland_c2;

pub use gaussian::Gaussian;
pub use lambda44::Lambda44;
pub use radial::RadialKernel;
pub use wendland_c2::WendlandC2;

use crate::geometry::Vector;

/// A kernel W with bounded support and ∫ W dx = 1.
///
/// ```
/// use meniscus::{geometry::Vector, smoothing_kernels::{SmoothingKernel, WendlandC2}};
///
/// let kernel = WendlandC2 { smoothing_length: 0.1 };
/// assert_eq!(kernel.value(&Vector::<2>::new(0.2, 0.0)), 0.0);
/// ```
pub trait SmoothingKernel<const D: usize>: Send + Sync {
    /// Kernel value W(dx), with the dimension 1/length^D.
    fn value(&self, dx: &Vector<D>) -> f64;

    /// Radius beyond which W vanishes.
    fn support(&self) -> f64;
}

#[cfg(test)]
mod tests {
    use super::{Gaussian, Lambda44, SmoothingKernel, Vector, WendlandC2};

    fn integral<const D: usize>(kernel: &dyn SmoothingKernel<D>, step: f64) -> f64 {
        let n = (kernel.support() / step).ceil() as i64;
        let side = 2 * n + 1;
        let sum: f64 = (0..side.pow(D as u32))
            .map(|cell| {
                let mut rest = cell;
                kernel.value(&Vector::<D>::from_fn(|_, _| {
                    let k = rest % side - n;
                    rest /= side;
                    k as f64 * step
                }))
            })
            .sum();
        sum * step.powi(D as i32)
    }

    #[test]
    fn kernels_integrate_to_one() {
        let close = |value: f64, tolerance: f64| assert!((value - 1.0).abs() < tolerance, "{value}");
        close(integral::<2>(&WendlandC2 { smoothing_length: 0.3 }, 0.01), 1e-6);
        close(integral::<3>(&WendlandC2 { smoothing_length: 0.3 }, 0.02), 1e-4);
        close(integral::<2>(&Lambda44 { spacing: 0.1 }, 0.01), 1e-6);
        close(integral::<3>(&Lambda44 { spacing: 0.1 }, 0.02), 1e-4);
        // The cut at three smoothing lengths drops exp(−9).
        close(integral::<2>(&Gaussian { smoothing_length: 0.3 }, 0.01), 2e-4);
        close(integral::<3>(&Gaussian { smoothing_length: 0.3 }, 0.03), 1e-3);
    }
}
