//! Kernels of the distance alone for loops over pairs: value and slope as polynomials of q = r/ε, for one number or several
//! side by side.
//!
//! W(r) = σ_D/ε^D w(q), ∂W/∂r · 1/r = σ_D/ε^(D+2) w'(q)/q.

use crate::linear_algebra::number::Number;
use std::f64::consts::PI;

/// A kernel of q = r/ε that vanishes smoothly at q = [`Self::SUPPORT`] and beyond.
pub trait RadialKernel: Copy + Send + Sync + 'static {
    /// Where it ends.
    const SUPPORT: f64;

    /// σ_D: what makes w integrate to one over q in D dimensions.
    fn normalization(dimension: usize) -> f64;

    /// w(q).
    fn value<T: Number>(q: T) -> T;

    /// w'(q)/q without its factor [`Self::SLOPE`]; finite at 0.
    fn slope_over_q<T: Number>(q: T) -> T;

    /// The factor of slopes.
    const SLOPE: f64;
}

/// What is left of `end` − q·`by`, at least zero.
#[inline(always)]
fn rest<T: Number>(q: T, by: f64, end: f64) -> T {
    q.mul_add(T::splat(-by), T::splat(end)).positive_part()
}

/// Keeps divisions by q finite: below it slopes are zero anyway.
const TINY: f64 = 1e-150;

/// Wendland's C² kernel: w = (1 − q/2)⁴ (1 + 2q) (PCP eq. A.6).
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
        let t = rest(q, 0.5, 1.0);
        let t2 = t * t;
        t2 * t2 * q.mul_add(T::splat(2.0), T::splat(1.0))
    }

    #[inline(always)]
    fn slope_over_q<T: Number>(q: T) -> T {
        let t = rest(q, 0.5, 1.0);
        t * t * t
    }
}

/// Wendland's C⁴ kernel: w = (1 − q/2)⁶ (35/12 q² + 3q + 1) (Dehnen and Aly 2012, table 1).
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
        let t = rest(q, 0.5, 1.0);
        let (t2, bracket) = (t * t, q.mul_add(T::splat(35.0 / 12.0), T::splat(3.0)));
        t2 * t2 * t2 * bracket.mul_add(q, T::splat(1.0))
    }

    #[inline(always)]
    fn slope_over_q<T: Number>(q: T) -> T {
        let t = rest(q, 0.5, 1.0);
        let t2 = t * t;
        t2 * t2 * t * q.mul_add(T::splat(2.5), T::splat(1.0))
    }
}

/// The cubic spline: w = (2 − q)³/4 − (1 − q)³ (Monaghan 1992).
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
        let (a, b) = (rest(q, 1.0, 2.0), rest(q, 1.0, 1.0));
        T::splat(0.25) * (a * a * a) - b * b * b
    }

    #[inline(always)]
    fn slope_over_q<T: Number>(q: T) -> T {
        let (a, b) = (rest(q, 1.0, 2.0), rest(q, 1.0, 1.0));
        (T::splat(3.0) * (b * b) - T::splat(0.75) * (a * a)) / q.max(T::splat(TINY))
    }
}

/// The quintic spline: w = (3 − q)⁵ − 6 (2 − q)⁵ + 15 (1 − q)⁵ (Morris 1996).
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
            let t = rest(q, 1.0, end);
            let t2 = t * t;
            t2 * t2 * t
        };
        T::splat(15.0).mul_add(fifth(1.0), T::splat(-6.0).mul_add(fifth(2.0), fifth(3.0)))
    }

    #[inline(always)]
    fn slope_over_q<T: Number>(q: T) -> T {
        let fourth = |end: f64| {
            let t = rest(q, 1.0, end);
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
