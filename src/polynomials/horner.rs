//! Values and derivatives of polynomials by Horner's scheme, for single numbers and for lanes.
//!
//! The coefficients of t^α are in nested order: the exponent of the last axis runs fastest, and each exponent runs up
//! to what the total degree leaves. An evaluation passes through them once, from the last to the first.

use super::MAX_DEGREE;
use crate::linear_algebra::number::Number;

/// Value and derivatives of a polynomial p with respect to its local coordinates t.
#[derive(Debug, Clone, Copy)]
pub struct Derivatives<T, const D: usize> {
    /// Value p(t).
    pub value: T,
    /// First derivatives ∂p/∂t_d.
    pub first: [T; D],
    /// Second derivatives ∂²p/∂t_d∂t_e.
    pub second: [[T; D]; D],
}

/// Multi-indices up to a total degree in nested order.
#[must_use]
pub fn nested_indices<const D: usize>(degree: usize) -> Vec<[u8; D]> {
    let mut indices = Vec::new();
    let outer = if D == 3 { degree } else { 0 };
    for i in 0..=outer {
        for j in 0..=degree - i {
            for k in 0..=degree - i - j {
                let mut index = [0; D];
                index[D - 1] = k as u8;
                index[D - 2] = j as u8;
                if D == 3 {
                    index[0] = i as u8;
                }
                indices.push(index);
            }
        }
    }
    indices
}

/// Value, gradient and Hessian at `t` of the polynomial of the given degree, whose coefficient at position a of the
/// nested order is `coefficient(a)`.
#[inline(always)]
pub fn derivatives<T: Number, const D: usize>(
    degree: usize,
    coefficient: impl Fn(usize) -> T,
    t: &[T; D],
) -> Derivatives<T, D> {
    // A constant degree lets the compiler unroll the loops.
    match degree {
        1 => unrolled::<T, D, 1>(coefficient, t),
        2 => unrolled::<T, D, 2>(coefficient, t),
        3 => unrolled::<T, D, 3>(coefficient, t),
        4 => unrolled::<T, D, 4>(coefficient, t),
        5 => unrolled::<T, D, 5>(coefficient, t),
        6 => unrolled::<T, D, 6>(coefficient, t),
        7 => unrolled::<T, D, 7>(coefficient, t),
        _ => unrolled::<T, D, MAX_DEGREE>(coefficient, t),
    }
}

/// [`derivatives`] for a degree N that is known to the compiler.
#[inline(always)]
fn unrolled<T: Number, const D: usize, const N: usize>(
    coefficient: impl Fn(usize) -> T,
    t: &[T; D],
) -> Derivatives<T, D> {
    let zero = T::splat(0.0);
    let (y, z) = (t[D - 2], t[D - 1]);
    let outer = if D == 3 { N } else { 0 };
    let mut place = super::multi_index::term_count::<D>(N);
    // Suffixes name the axes, of which x is the outermost of three. `vxx`, `vyy` and `vzz` are halves of second
    // derivatives.
    let [mut v, mut vx, mut vy, mut vz] = [zero; 4];
    let [mut vxx, mut vxy, mut vxz, mut vyy, mut vyz, mut vzz] = [zero; 6];
    for i in (0..=outer).rev() {
        let [mut w, mut wy, mut wz, mut wyy, mut wyz, mut wzz] = [zero; 6];
        for j in (0..=N - i).rev() {
            let [mut s, mut sz, mut szz] = [zero; 3];
            for _ in 0..=N - i - j {
                place -= 1;
                szz = szz.mul_add(z, sz);
                sz = sz.mul_add(z, s);
                s = s.mul_add(z, coefficient(place));
            }
            wyy = wyy.mul_add(y, wy);
            wy = wy.mul_add(y, w);
            w = w.mul_add(y, s);
            wyz = wyz.mul_add(y, wz);
            wz = wz.mul_add(y, sz);
            wzz = wzz.mul_add(y, szz);
        }
        if D == 3 {
            let x = t[0];
            vxx = vxx.mul_add(x, vx);
            vx = vx.mul_add(x, v);
            v = v.mul_add(x, w);
            vxy = vxy.mul_add(x, vy);
            vy = vy.mul_add(x, wy);
            vxz = vxz.mul_add(x, vz);
            vz = vz.mul_add(x, wz);
            vyy = vyy.mul_add(x, wyy);
            vyz = vyz.mul_add(x, wyz);
            vzz = vzz.mul_add(x, wzz);
        } else {
            [v, vy, vz, vyy, vyz, vzz] = [w, wy, wz, wyy, wyz, wzz];
        }
    }
    collect(v, [vx, vy, vz], [vxx, vxy, vxz, vyy, vyz, vzz])
}

/// Value and derivatives from their components by axis; in the plane the axes are y and z.
///
/// `second` holds xx/2, xy, xz, yy/2, yz and zz/2.
#[inline(always)]
fn collect<T: Number, const D: usize>(value: T, first: [T; 3], second: [T; 6]) -> Derivatives<T, D> {
    let two = T::splat(2.0);
    let ([vx, vy, vz], [vxx, vxy, vxz, vyy, vyz, vzz]) = (first, second);
    let mut first = [value; D];
    let mut second = [[value; D]; D];
    first[D - 2] = vy;
    first[D - 1] = vz;
    second[D - 2][D - 2] = two * vyy;
    second[D - 2][D - 1] = vyz;
    second[D - 1][D - 2] = vyz;
    second[D - 1][D - 1] = two * vzz;
    if D == 3 {
        first[0] = vx;
        second[0][0] = two * vxx;
        second[0][1] = vxy;
        second[0][2] = vxz;
        second[1][0] = vxy;
        second[2][0] = vxz;
    }
    Derivatives { value, first, second }
}
