//! Polynomials in M coordinates up to a total degree, without the constant.
//!
//! They are products of Chebyshev polynomials, which keep the moment matrix well conditioned up to degree 7. Their
//! values at the origin are subtracted, so that a fit reproduces the value at its own point exactly.

use crate::linear_algebra::number::{Lanes, Number};
use crate::polynomials::multi_index::MultiIndexSet;

/// Largest total degree.
pub(super) const MAX_DEGREE: usize = 7;

/// Derivatives T_n^(k)(0) for n and k up to the largest degree, from T_{n+1} = 2 x T_n − T_{n−1}.
fn derivatives_at_origin() -> [[f64; MAX_DEGREE + 1]; MAX_DEGREE + 1] {
    let mut t = [[0.0; MAX_DEGREE + 1]; MAX_DEGREE + 1];
    t[0][0] = 1.0;
    t[1][1] = 1.0;
    for n in 2..=MAX_DEGREE {
        for k in 0..=MAX_DEGREE {
            let rise = if k > 0 { 2.0 * k as f64 * t[n - 1][k - 1] } else { 0.0 };
            t[n][k] = rise - t[n - 2][k];
        }
    }
    t
}

/// The functions ∏ T_{a_d}(x_d) − ∏ T_{a_d}(0) with 1 ≤ Σ a_d ≤ degree, sorted by total degree.
#[derive(Debug, Clone)]
pub(super) struct Basis<const M: usize> {
    /// Total degree of the basis.
    degree: usize,
    /// Degrees a of the factors of each function, and the product ∏ T_{a_d}(0).
    functions: Vec<([u8; M], f64)>,
    /// Derivatives ∂^α of all functions at the origin, by the multi-index α.
    derivatives: Vec<f64>,
}

impl<const M: usize> Basis<M> {
    /// The basis up to a total degree, at most [`MAX_DEGREE`].
    pub fn new(degree: usize) -> Self {
        let degree = degree.min(MAX_DEGREE);
        let at_origin = derivatives_at_origin();
        let set = MultiIndexSet::<M>::total_degree(degree);
        let indices = &set.indices()[1..];
        let derivative = |degrees: &[u8; M], alpha: &[u8; M]| -> f64 {
            degrees.iter().zip(alpha).map(|(n, k)| at_origin[usize::from(*n)][usize::from(*k)]).product()
        };
        let functions = indices.iter().map(|a| (*a, derivative(a, &[0; M]))).collect();
        let derivatives = indices.iter().flat_map(|alpha| indices.iter().map(|a| derivative(a, alpha))).collect();
        Self { degree, functions, derivatives }
    }

    /// Number of functions.
    pub fn size(&self) -> usize {
        self.functions.len()
    }

    /// Writes the values of all functions at the scaled coordinates `x`.
    #[inline(always)]
    pub fn values(&self, x: [Lanes; M], out: &mut [Lanes]) {
        let one = Lanes::splat(1.0);
        let mut t = [[one; MAX_DEGREE + 1]; M];
        for (t, x) in t.iter_mut().zip(x) {
            t[1] = x;
            for n in 2..=self.degree {
                t[n] = Number::mul_add(x + x, t[n - 1], -t[n - 2]);
            }
        }
        for (out, (a, origin)) in out.iter_mut().zip(&self.functions) {
            let mut product = t[0][usize::from(a[0]) & MAX_DEGREE];
            for d in 1..M - 1 {
                product *= t[d][usize::from(a[d]) & MAX_DEGREE];
            }
            let last = if M > 1 { t[M - 1][usize::from(a[M - 1]) & MAX_DEGREE] } else { one };
            *out = Number::mul_add(product, last, Lanes::splat(-origin));
        }
    }

    /// Derivatives of all functions along `direction` at the scaled coordinates `x`.
    pub fn slopes(&self, x: [f64; M], direction: [f64; M], out: &mut Vec<f64>) {
        let mut t = [[1.0; MAX_DEGREE + 1]; M];
        let mut slope = [[0.0; MAX_DEGREE + 1]; M];
        for ((t, slope), x) in t.iter_mut().zip(&mut slope).zip(x) {
            (t[1], slope[1]) = (x, 1.0);
            for n in 2..=self.degree {
                t[n] = 2.0 * x * t[n - 1] - t[n - 2];
                slope[n] = 2.0 * t[n - 1] + 2.0 * x * slope[n - 1] - slope[n - 2];
            }
        }
        let derivative = |a: &[u8; M], along: usize| -> f64 {
            (0..M).map(|d| if d == along { slope[d] } else { t[d] }[usize::from(a[d])]).product()
        };
        let at = |(a, _): &([u8; M], f64)| (0..M).map(|d| direction[d] * derivative(a, d)).sum::<f64>();
        out.clear();
        out.extend(self.functions.iter().map(at));
    }

    /// Derivatives ∂^α of all functions at the origin, in scaled coordinates. None for α = 0 or beyond the degree.
    pub fn derivative(&self, alpha: &[u8; M]) -> Option<&[f64]> {
        let place = self.functions.iter().position(|(a, _)| a == alpha)?;
        Some(&self.derivatives[place * self.size()..(place + 1) * self.size()])
    }
}

#[cfg(test)]
mod tests {
    use super::{Basis, Lanes};

    fn at<const M: usize>(basis: &Basis<M>, x: [f64; M]) -> Vec<f64> {
        let mut out = vec![Lanes::splat(0.0); basis.size()];
        basis.values(x.map(Lanes::splat), &mut out);
        out.iter().map(|v| v.to_array()[0]).collect()
    }

    fn check<const M: usize>(degree: usize) {
        let basis = Basis::<M>::new(degree);
        let step = 1e-3;
        assert!(at(&basis, [0.0; M]).iter().all(|value| *value == 0.0));
        for d in 0..M {
            let moved = |by: f64| at(&basis, std::array::from_fn(|k| if k == d { by } else { 0.0 }));
            let (up, down) = (moved(step), moved(-step));
            let unit = |order: u8| std::array::from_fn::<u8, M, _>(|k| if k == d { order } else { 0 });
            let (first, second) = (basis.derivative(&unit(1)).unwrap(), basis.derivative(&unit(2)).unwrap());
            for k in 0..basis.size() {
                assert!(((up[k] - down[k]) / (2.0 * step) - first[k]).abs() < 1e-3);
                assert!(((up[k] + down[k]) / (step * step) - second[k]).abs() < 1e-2);
            }
        }
        assert!(basis.derivative(&[0; M]).is_none());
        // Slopes away from the origin, by central differences.
        let (x, direction) = ([0.3; M], std::array::from_fn::<f64, M, _>(|d| 1.0 - 0.4 * d as f64));
        let moved = |by: f64| at(&basis, std::array::from_fn(|d| x[d] + by * direction[d]));
        let (up, down) = (moved(1e-5), moved(-1e-5));
        let mut slopes = Vec::new();
        basis.slopes(x, direction, &mut slopes);
        for k in 0..basis.size() {
            assert!(((up[k] - down[k]) / 2e-5 - slopes[k]).abs() < 1e-7 * (1.0 + slopes[k].abs()), "{k}");
        }
    }

    #[test]
    fn functions_vanish_at_the_origin_and_their_derivatives_are_those_of_differences() {
        for degree in [3, 5, 7] {
            check::<1>(degree);
            check::<2>(degree);
            check::<3>(degree);
        }
        let basis = Basis::<2>::new(3);
        // The mixed derivative belongs to a single function.
        let mixed = basis.derivative(&[1, 1]).unwrap();
        assert_eq!(mixed.iter().filter(|v| **v != 0.0).count(), 1);
    }
}
