//! Which kernel: chosen by name, a type of its own inside the loops.

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

/// Calls an expression with `K` standing for the type of a chosen kernel.
macro_rules! with_kernel {
    ($choice:expr, $kernel:ident => $value:expr) => {
        match $choice {
            KernelChoice::WendlandC2 => {
                type $kernel = crate::smoothing_kernels::radial::WendlandC2Radial;
                $value
            }
            KernelChoice::WendlandC4 => {
                type $kernel = crate::smoothing_kernels::radial::WendlandC4Radial;
                $value
            }
            KernelChoice::CubicSpline => {
                type $kernel = crate::smoothing_kernels::radial::CubicSplineRadial;
                $value
            }
            KernelChoice::QuinticSpline => {
                type $kernel = crate::smoothing_kernels::radial::QuinticSplineRadial;
                $value
            }
        }
    };
}
pub(super) use with_kernel;

impl KernelChoice {
    /// Where it ends, in ε.
    #[must_use]
    pub fn support(self) -> f64 {
        match self {
            Self::WendlandC2 => WendlandC2Radial::SUPPORT,
            Self::WendlandC4 => WendlandC4Radial::SUPPORT,
            Self::CubicSpline => CubicSplineRadial::SUPPORT,
            Self::QuinticSpline => QuinticSplineRadial::SUPPORT,
        }
    }

    /// σ_D.
    #[must_use]
    pub fn normalization(self, dimension: usize) -> f64 {
        with_kernel!(self, K => K::normalization(dimension))
    }

    /// The factor of its slopes.
    pub(super) fn slope(self) -> f64 {
        with_kernel!(self, K => K::SLOPE)
    }

    /// w(q).
    pub(super) fn value(self, q: f64) -> f64 {
        with_kernel!(self, K => K::value(q))
    }
}
