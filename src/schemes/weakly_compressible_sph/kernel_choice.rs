//! The smoothing kernel: chosen by name, a type of its own inside the loops.

use crate::smoothing_kernels::RadialKernel;
use crate::smoothing_kernels::radial::{CubicSplineRadial, QuinticSplineRadial, WendlandC2Radial, WendlandC4Radial};

/// A kernel of the scheme.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KernelChoice {
    /// Wendland's C².
    WendlandC2,
    /// Wendland's C⁴.
    WendlandC4,
    /// The cubic spline.
    CubicSpline,
    /// The quintic spline.
    QuinticSpline,
}

/// Evaluates an expression in which `K` stands for the type of a chosen kernel.
macro_rules! with_kernel {
    ($choice:expr, $kernel:ident => $value:expr) => {
        match $choice {
            $crate::schemes::weakly_compressible_sph::KernelChoice::WendlandC2 => {
                type $kernel = $crate::smoothing_kernels::radial::WendlandC2Radial;
                $value
            }
            $crate::schemes::weakly_compressible_sph::KernelChoice::WendlandC4 => {
                type $kernel = $crate::smoothing_kernels::radial::WendlandC4Radial;
                $value
            }
            $crate::schemes::weakly_compressible_sph::KernelChoice::CubicSpline => {
                type $kernel = $crate::smoothing_kernels::radial::CubicSplineRadial;
                $value
            }
            $crate::schemes::weakly_compressible_sph::KernelChoice::QuinticSpline => {
                type $kernel = $crate::smoothing_kernels::radial::QuinticSplineRadial;
                $value
            }
        }
    };
}
pub(super) use with_kernel;

impl KernelChoice {
    /// The ratio r/ε at which the kernel vanishes.
    #[must_use]
    pub fn support(self) -> f64 {
        match self {
            Self::WendlandC2 => WendlandC2Radial::SUPPORT,
            Self::WendlandC4 => WendlandC4Radial::SUPPORT,
            Self::CubicSpline => CubicSplineRadial::SUPPORT,
            Self::QuinticSpline => QuinticSplineRadial::SUPPORT,
        }
    }

    /// The factor σ_D that makes the integral of the kernel 1 in `dimension` dimensions.
    #[must_use]
    pub fn normalization(self, dimension: usize) -> f64 {
        with_kernel!(self, K => K::normalization(dimension))
    }
}

/// A kernel of a smoothing length, W(r) = σ_D/ε^D w(r/ε). Loops over pairs compute with w alone; what they sum is scaled
/// afterwards.
#[derive(Debug, Clone, Copy)]
pub(super) struct ScaledKernel {
    /// The shape w.
    pub choice: KernelChoice,
    /// The smoothing length ε.
    pub smoothing_length: f64,
    /// The factor σ_D/ε^D of values.
    pub normalization: f64,
}

impl ScaledKernel {
    pub fn new(choice: KernelChoice, smoothing_length: f64, dimension: usize) -> Self {
        let normalization = choice.normalization(dimension) / smoothing_length.powi(dimension as i32);
        Self { choice, smoothing_length, normalization }
    }

    /// w(q).
    pub fn value(&self, q: f64) -> f64 {
        with_kernel!(self.choice, K => K::value(q))
    }

    /// The constant factor of w'(q)/q that loops over pairs leave out.
    pub fn slope(&self) -> f64 {
        with_kernel!(self.choice, K => K::SLOPE)
    }
}
