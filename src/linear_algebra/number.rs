//! What hot loops compute with: one number, or several side by side in a vector register. One implementation of a
//! formula serves both, and a lane gives the same bits wherever it stands and whatever its neighbors hold.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Several numbers side by side.
pub type Lanes = wide::f64x4;

/// How many.
pub const LANES: usize = 4;

/// A number or [`Lanes`] of them.
pub trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// The same value in every lane.
    fn splat(value: f64) -> Self;
    /// self · factor + summand, fused where the machine can.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
    /// The square root.
    fn sqrt(self) -> Self;
    /// The larger one; of a NaN and a number the number.
    fn max(self, other: Self) -> Self;
    /// The number where it is positive, else 0; also of a NaN.
    fn positive_part(self) -> Self;
    /// |self| with the sign of `sign`, where zero counts as positive.
    fn copysign(self, sign: Self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        // Without the instruction the fused form is a slow library call.
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

/// Scalar product.
#[inline(always)]
pub fn dot<T: Number, const D: usize>(a: &[T; D], b: &[T; D]) -> T {
    let mut sum = a[0] * b[0];
    for d in 1..D {
        sum = a[d].mul_add(b[d], sum);
    }
    sum
}

/// a + s b.
#[inline(always)]
pub fn add_scaled<T: Number, const D: usize>(a: &[T; D], s: T, b: &[T; D]) -> [T; D] {
    let mut sum = *a;
    for d in 0..D {
        sum[d] = s.mul_add(b[d], a[d]);
    }
    sum
}

/// a − b.
#[inline(always)]
pub fn difference<T: Number, const D: usize>(a: &[T; D], b: &[T; D]) -> [T; D] {
    let mut difference = *a;
    for d in 0..D {
        difference[d] = a[d] - b[d];
    }
    difference
}

/// A b for a symmetric matrix.
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
