//! Kernels of the distance alone, for sums over pairs of particles.
//!
//! Value and slope are polynomials of q = r/ε for one number or several lanes: W(r) = σ_D/ε^D w(q) and (∂W/∂r)/r =
//! σ_D/ε^(D+2) w'(q)/q.

use crate::linear_algebra::number::Number;
use std::f64::consts::PI;

/// A kernel w(q), q = r/ε, that vanishes for q ≥ [`Self::SUPPORT`].
///
/// ```
/// use meniscus::smoothing_kernels::{RadialKernel, radial::WendlandC2Radial};
///
/// assert_eq!(WendlandC2Radial::value(0.0), 1.0);
/// assert_eq!(WendlandC2Radial::value(2.5), 0.0);
/// ```
pub trait RadialKernel: Copy + Send + Sync + 'static {
    /// Radius of the support, in q.
    const SUPPORT: f64;

    /// Factor σ_D with which w integrates to one over the D-dimensional space of q.
    fn normalization(dimension: usize) -> f64;

    /// Kernel value w(q).
    fn value<T: Number>(q: T) -> T;

    /// Scaled slope w'(q)/q without its factor [`Self::SLOPE`]; finite at q = 0.
    fn slope_over_q<T: Number>(q: T) -> T;

    /// Constant factor of [`Self::slope_over_q`].
    const SLOPE: f64;
}

/// The positive part of `end` − `factor`·q.
#[inline(always)]
fn remainder<T: Number>(q: T, factor: f64, end: f64) -> T {
    q.mul_add(T::splat(-factor), T::splat(end)).positive_part()
}

/// Smallest divisor q, which keeps quotients finite. At smaller q the slopes vanish.
const TINY: f64 = 1e-150;

/// Wendland's C² kernel w = (1 − q/2)⁴ (1 + 2q) (Wendland 1995; PCP eq. A.6).
#[derive(Debug, Clone, Copy)]
pub struct WendlandC2Radial;

impl RadialKernel for WendlandC2Radial {
    const SUPPORT: f64 = 2.0;
    const SLOPE: f64 = -5.0;

    fn normalization(dimension: usize) -> f64 {
        if dimension == 2 { 7.0 / (4.0 * PI) } else { 21.0 / (16.0 * PI) }
    }

    #[inline(always)]
    fn value<T: Number>(q: T) -> T {
        let t = remainder(q, 0.5, 1.0);
        let t2 = t * t;
        t2 * t2 * q.mul_add(T::splat(2.0), T::splat(1.0))
    }

    #[inline(always)]
    fn slope_over_q<T: Number>(q: T) -> T {
        let t = remainder(q, 0.5, 1.0);
        t * t * t
    }
}

/// Wendland's C⁴ kernel w = (1 − q/2)⁶ (35/12 q² + 3q + 1) (Dehnen 2012, table 1).
#[derive(Debug, Clone, Copy)]
pub struct WendlandC4Radial;

impl RadialKernel for WendlandC4Radial {
    const SUPPORT: f64 = 2.0;
    const SLOPE: f64 = -14.0 / 3.0;

    fn normalization(dimension: usize) -> f64 {
        if dimension == 2 { 9.0 / (4.0 * PI) } else { 495.0 / (256.0 * PI) }
    }

    #[inline(always)]
    fn value<T: Number>(q: T) -> T {
        let t = remainder(q, 0.5, 1.0);
        let (t2, bracket) = (t * t, q.mul_add(T::splat(35.0 / 12.0), T::splat(3.0)));
        t2 * t2 * t2 * bracket.mul_add(q, T::splat(1.0))
    }

    #[inline(always)]
    fn slope_over_q<T: Number>(q: T) -> T {
        let t = remainder(q, 0.5, 1.0);
        let t2 = t * t;
        t2 * t2 * t * q.mul_add(T::splat(2.5), T::splat(1.0))
    }
}

/// The cubic spline w = (2 − q)³/4 − (1 − q)³, each term only where it is positive (Monaghan 1992).
#[derive(Debug, Clone, Copy)]
pub struct CubicSplineRadial;

impl RadialKernel for CubicSplineRadial {
    const SUPPORT: f64 = 2.0;
    const SLOPE: f64 = 1.0;

    fn normalization(dimension: usize) -> f64 {
        if dimension == 2 { 10.0 / (7.0 * PI) } else { 1.0 / PI }
    }

    #[inline(always)]
    fn value<T: Number>(q: T) -> T {
        let (a, b) = (remainder(q, 1.0, 2.0), remainder(q, 1.0, 1.0));
        T::splat(0.25) * (a * a * a) - b * b * b
    }

    #[inline(always)]
    fn slope_over_q<T: Number>(q: T) -> T {
        let (a, b) = (remainder(q, 1.0, 2.0), remainder(q, 1.0, 1.0));
        (T::splat(3.0) * (b * b) - T::splat(0.75) * (a * a)) / q.max(T::splat(TINY))
    }
}

/// The quintic spline w = (3 − q)⁵ − 6 (2 − q)⁵ + 15 (1 − q)⁵, each power only where its base is positive (Morris
/// 1996).
#[derive(Debug, Clone, Copy)]
pub struct QuinticSplineRadial;

impl RadialKernel for QuinticSplineRadial {
    const SUPPORT: f64 = 3.0;
    const SLOPE: f64 = 1.0;

    fn normalization(dimension: usize) -> f64 {
        if dimension == 2 { 7.0 / (478.0 * PI) } else { 1.0 / (120.0 * PI) }
    }

    #[inline(always)]
    fn value<T: Number>(q: T) -> T {
        let fifth = |end: f64| {
            let t = remainder(q, 1.0, end);
            let t2 = t * t;
            t2 * t2 * t
        };
        T::splat(15.0).mul_add(fifth(1.0), T::splat(-6.0).mul_add(fifth(2.0), fifth(3.0)))
    }

    #[inline(always)]
    fn slope_over_q<T: Number>(q: T) -> T {
        let fourth = |end: f64| {
            let t = remainder(q, 1.0, end);
            let t2 = t * t;
            t2 * t2
        };
        let sum =
            T::splat(-75.0).mul_add(fourth(1.0), T::splat(30.0).mul_add(fourth(2.0), T::splat(-5.0) * fourth(3.0)));
        sum / q.max(T::splat(TINY))
    }
}

#[cfg(test)]
mod tests {
    use super::{CubicSplineRadial, PI, QuinticSplineRadial, RadialKernel, WendlandC2Radial, WendlandC4Radial};

    fn check<K: RadialKernel>() {
        let steps = 30_000;
        let dq = K::SUPPORT / f64::from(steps);
        let at = |k: i32| (f64::from(k) + 0.5) * dq;
        let circle: f64 = (0..steps).map(|k| K::value(at(k)) * 2.0 * PI * at(k)).sum();
        let sphere: f64 = (0..steps).map(|k| K::value(at(k)) * 4.0 * PI * at(k) * at(k)).sum();
        assert!((circle * dq * K::normalization(2) - 1.0).abs() < 1e-8);
        assert!((sphere * dq * K::normalization(3) - 1.0).abs() < 1e-8);
        for k in 0..64 {
            let q = K::SUPPORT * f64::from(k) / 64.0 + 0.003;
            let difference = (K::value(q + 1e-5) - K::value(q - 1e-5)) / 2e-5;
            assert!((K::SLOPE * K::slope_over_q(q) * q - difference).abs() < 1e-7 * K::value(0.0), "q = {q}");
        }
        assert!(K::slope_over_q(0.0).is_finite());
        assert_eq!(K::value(K::SUPPORT + 0.1), 0.0);
        assert_eq!(K::slope_over_q(1e15), 0.0);
    }

    #[test]
    fn kernels_integrate_to_one_and_slopes_are_derivatives() {
        check::<WendlandC2Radial>();
        check::<WendlandC4Radial>();
        check::<CubicSplineRadial>();
        check::<QuinticSplineRadial>();
    }
}
