//! Numbers of hot loops: a single `f64`, or several side by side in a vector register.
//!
//! One implementation of a formula serves both. The result of a lane does not depend on its position or on the other
//! lanes, to the last bit.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// [`LANES`] numbers in one vector register.
pub type Lanes = wide::f64x4;

/// Numbers per vector register.
pub const LANES: usize = 4;

/// A single number, or [`Lanes`] of numbers.
///
/// ```
/// use meniscus::linear_algebra::number::{Lanes, Number};
///
/// fn square_plus_one<T: Number>(x: T) -> T {
///     x.mul_add(x, T::splat(1.0))
/// }
/// assert_eq!(square_plus_one(2.0), 5.0);
/// assert_eq!(square_plus_one(Lanes::splat(2.0)).to_array(), [5.0; 4]);
/// ```
pub trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// The number with `value` in every lane.
    fn splat(value: f64) -> Self;
    /// `self · factor + summand`, with one rounding where the processor has the instruction.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// The larger of two numbers. If one is a NaN, the other.
    fn max(self, other: Self) -> Self;
    /// `self` where it is positive, else 0. The positive part of a NaN is 0.
    fn positive_part(self) -> Self;
    /// |self| with the sign of `sign`. Zero of either sign counts as positive.
    fn copysign(self, sign: Self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        // Without the instruction, the fused form is a slow library call.
        if cfg!(target_feature = "fma") { f64::mul_add(self, factor, summand) } else { self * factor + summand }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        f64::max(self, other)
    }

    #[inline(always)]
    fn positive_part(self) -> Self {
        if self > 0.0 { self } else { 0.0 }
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        if sign < 0.0 { -self.abs() } else { self.abs() }
    }
}

impl Number for Lanes {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self::splat(value)
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        Self::mul_add(self, factor, summand)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::max(self, other)
    }

    #[inline(always)]
    fn positive_part(self) -> Self {
        self.fast_max(Self::splat(0.0))
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        let magnitude = self.abs();
        sign.simd_lt(Self::splat(0.0)).select(-magnitude, magnitude)
    }
}

/// Scalar product a·b.
#[inline(always)]
pub fn dot<T: Number, const D: usize>(a: &[T; D], b: &[T; D]) -> T {
    let mut sum = a[0] * b[0];
    for d in 1..D {
        sum = a[d].mul_add(b[d], sum);
    }
    sum
}

/// The vector a + s b.
#[inline(always)]
pub fn add_scaled<T: Number, const D: usize>(a: &[T; D], s: T, b: &[T; D]) -> [T; D] {
    let mut sum = *a;
    for d in 0..D {
        sum[d] = s.mul_add(b[d], a[d]);
    }
    sum
}

/// The vector a − b.
#[inline(always)]
pub fn difference<T: Number, const D: usize>(a: &[T; D], b: &[T; D]) -> [T; D] {
    let mut difference = *a;
    for d in 0..D {
        difference[d] = a[d] - b[d];
    }
    difference
}

/// The product A b for a symmetric matrix A.
#[inline(always)]
pub fn multiply_symmetric<T: Number, const D: usize>(matrix: &[[T; D]; D], b: &[T; D]) -> [T; D] {
    let mut product = *b;
    for d in 0..D {
        product[d] = dot(&matrix[d], b);
    }
    product
}

#[cfg(test)]
mod tests {
    use super::{LANES, Lanes, Number};

    #[test]
    fn lanes_give_the_bits_of_single_numbers() {
        let a = [0.3, -7.25, 1e-9, 2.0 / 3.0];
        let b = [-1.7, 0.1, 3.0e7, -0.0];
        let c = [1e-3, -4.0, 0.9, 5.0];
        let (x, y, z) = (Lanes::new(a), Lanes::new(b), Lanes::new(c));
        for l in 0..LANES {
            assert_eq!(Number::mul_add(x, y, z).to_array()[l].to_bits(), Number::mul_add(a[l], b[l], c[l]).to_bits());
            assert_eq!(Number::copysign(x, y).to_array()[l].to_bits(), Number::copysign(a[l], b[l]).to_bits());
            assert_eq!(Number::max(x, y).to_array()[l], Number::max(a[l], b[l]));
            assert_eq!(Number::sqrt(y * y).to_array()[l], b[l].abs());
            assert_eq!((x / z).to_array()[l].to_bits(), (a[l] / c[l]).to_bits());
        }
    }
}
