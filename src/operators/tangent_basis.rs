//! Polynomials of two tangential coordinates up to a total degree, without the constant: products of Chebyshev
//! polynomials, which keep the moment matrix well conditioned up to degree 7, less their value at the origin, so that a fit
//! takes the value of its point exactly.

use crate::linear_algebra::number::{Lanes, Number};

/// Highest degree.
pub(super) const MOST_DEGREE: usize = 7;

/// T_n(0), T_n'(0), T_n''(0).
fn at_origin(n: usize) -> [f64; 3] {
    let (order, turn) = (n as f64, n % 4);
    let cosine = [1.0, 0.0, -1.0, 0.0][turn];
    let sine = [0.0, 1.0, 0.0, -1.0][turn];
    [cosine, order * sine, -order * order * cosine]
}

/// The functions up to a degree: T_a(x) T_b(y) − T_a(0) T_b(0) with 1 ≤ a + b ≤ degree, by total degree.
#[derive(Debug, Clone)]
pub(super) struct TangentBasis {
    degree: usize,
    /// Degrees, and the value at the origin.
    functions: Vec<(usize, usize, f64)>,
}

impl TangentBasis {
    pub fn new(degree: usize) -> Self {
        let degree = degree.min(MOST_DEGREE);
        let pairs = (1..=degree).flat_map(|total| (0..=total).map(move |b| (total - b, b)));
        let functions = pairs.map(|(a, b)| (a, b, at_origin(a)[0] * at_origin(b)[0])).collect();
        Self { degree, functions }
    }

    /// How many functions there are.
    pub fn size(&self) -> usize {
        self.functions.len()
    }

    /// The values of all functions at a place, scaled coordinates.
    #[inline(always)]
    pub fn values(&self, x: Lanes, y: Lanes, out: &mut [Lanes]) {
        let one = Lanes::splat(1.0);
        let (mut tx, mut ty) = ([one; MOST_DEGREE + 1], [one; MOST_DEGREE + 1]);
        (tx[1], ty[1]) = (x, y);
        for n in 2..=self.degree {
            tx[n] = Number::mul_add(x + x, tx[n - 1], -tx[n - 2]);
            ty[n] = Number::mul_add(y + y, ty[n - 1], -ty[n - 2]);
        }
        for (out, (a, b, origin)) in out.iter_mut().zip(&self.functions) {
            *out = Number::mul_add(tx[a & MOST_DEGREE], ty[b & MOST_DEGREE], Lanes::splat(-origin));
        }
    }

    /// ∂_xx + ∂_yy of every function at the origin, in scaled coordinates.
    pub fn laplacians(&self) -> Vec<f64> {
        let of = |(a, b, _): &(usize, usize, f64)| {
            let (a, b) = (at_origin(*a), at_origin(*b));
            a[2] * b[0] + a[0] * b[2]
        };
        self.functions.iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{Lanes, TangentBasis};

    #[test]
    fn functions_vanish_at_the_origin_and_their_laplacians_are_those_of_differences() {
        for degree in [3, 5, 7] {
            let basis = TangentBasis::new(degree);
            let step = 1e-3;
            let at = |x: f64, y: f64| -> Vec<f64> {
                let mut out = vec![Lanes::splat(0.0); basis.size()];
                basis.values(Lanes::splat(x), Lanes::splat(y), &mut out);
                out.iter().map(|v| v.to_array()[0]).collect()
            };
            let around = [at(step, 0.0), at(-step, 0.0), at(0.0, step), at(0.0, -step)];
            for (k, exact) in basis.laplacians().into_iter().enumerate() {
                assert_eq!(at(0.0, 0.0)[k], 0.0);
                let difference: f64 = around.iter().map(|values| values[k]).sum::<f64>() / (step * step);
                assert!((difference - exact).abs() < 1e-2, "degree {degree}, function {k}: {difference} {exact}");
            }
        }
    }
}
