//! A polynomial of local coordinates t = (x − centre)/scale, with exact derivatives.

use super::basis::PolynomialBasis;
use super::multi_index::term_count;
use crate::geometry::Vector;
use nalgebra::SMatrix;

/// A fitted polynomial, viewed over storage that belongs to someone else.
#[derive(Debug, Clone, Copy)]
pub struct LocalPolynomial<'a, const D: usize> {
    /// The basis, shared by all polynomials of one regression.
    pub basis: &'a PolynomialBasis<D>,
    /// Total degree of this polynomial, at most the basis'.
    pub degree: usize,
    /// Coefficients of the Newton factors in graded order.
    pub coefficients: &'a [f64],
    /// Origin of the local coordinates.
    pub centre: Vector<D>,
    /// Length of one local unit.
    pub scale: f64,
}

/// Value, gradient and Hessian at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet<const D: usize> {
    /// p(x).
    pub value: f64,
    /// ∇p(x).
    pub gradient: Vector<D>,
    /// ∇∇p(x).
    pub hessian: SMatrix<f64, D, D>,
}

impl<const D: usize> Jet<D> {
    /// The unit normal ∇p/|∇p| (PCP eq. 16), outward where p rises outward.
    #[must_use]
    pub fn normal(&self) -> Vector<D> {
        self.gradient / self.gradient.norm()
    }

    /// ∇·(∇p/|∇p|) = (tr H − nᵀ H n)/|∇p| (PCP eq. 17), in any dimension.
    #[must_use]
    pub fn curvature(&self) -> f64 {
        let n = self.normal();
        (self.hessian.trace() - n.dot(&(self.hessian * n))) / self.gradient.norm()
    }
}

impl<const D: usize> LocalPolynomial<'_, D> {
    /// p(x) at the displacement `dx = x − centre`.
    #[must_use]
    pub fn value(&self, dx: &Vector<D>) -> f64 {
        let factors: [_; D] = std::array::from_fn(|d| self.basis.factors(dx[d] / self.scale, self.degree));
        let terms = term_count::<D>(self.degree);
        self.coefficients[..terms]
            .iter()
            .zip(self.basis.indices())
            .map(|(c, index)| c * (0..D).map(|d| factors[d][index[d] as usize]).product::<f64>())
            .sum()
    }

    /// p, ∇p and ∇∇p at the displacement `dx = x − centre`.
    #[must_use]
    pub fn jet(&self, dx: &Vector<D>) -> Jet<D> {
        let jets: [_; D] = std::array::from_fn(|d| self.basis.factor_jets(dx[d] / self.scale, self.degree));
        let terms = term_count::<D>(self.degree);
        let mut value = 0.0;
        let mut gradient = Vector::<D>::zeros();
        let mut hessian = SMatrix::<f64, D, D>::zeros();
        for (c, index) in self.coefficients[..terms].iter().zip(self.basis.indices()) {
            let u: [f64; D] = std::array::from_fn(|d| jets[d].0[index[d] as usize]);
            let first: [f64; D] = std::array::from_fn(|d| jets[d].1[index[d] as usize]);
            value += c * u.iter().product::<f64>();
            for d in 0..D {
                let others: f64 = (0..D).filter(|&k| k != d).map(|k| u[k]).product();
                gradient[d] += c * first[d] * others;
                hessian[(d, d)] += c * jets[d].2[index[d] as usize] * others;
                for e in d + 1..D {
                    let rest: f64 = (0..D).filter(|&k| k != d && k != e).map(|k| u[k]).product();
                    hessian[(d, e)] += c * first[d] * first[e] * rest;
                }
            }
        }
        for d in 0..D {
            for e in d + 1..D {
                hessian[(e, d)] = hessian[(d, e)];
            }
        }
        let inverse = 1.0 / self.scale;
        Jet { value, gradient: gradient * inverse, hessian: hessian * (inverse * inverse) }
    }
}

#[cfg(test)]
mod tests {
    use super::{LocalPolynomial, PolynomialBasis, Vector};
    use crate::geometry::random::CounterRandom;
    use crate::polynomials::BasisKind;

    #[test]
    fn derivatives_agree_with_differences() {
        let random = CounterRandom::new(9);
        for kind in [BasisKind::Minter, BasisKind::Monomial] {
            let basis = PolynomialBasis::<3>::new(kind, 4);
            let coefficients: Vec<f64> = (0..35).map(|k| random.symmetric(&[k])).collect();
            let p = LocalPolynomial {
                basis: &basis,
                degree: 4,
                coefficients: &coefficients,
                centre: Vector::<3>::zeros(),
                scale: 0.7,
            };
            let x = Vector::<3>::new(0.2, -0.1, 0.35);
            let jet = p.jet(&x);
            assert!((jet.value - p.value(&x)).abs() < 1e-14);
            let step = 1e-5;
            for d in 0..3 {
                let mut e = Vector::<3>::zeros();
                e[d] = step;
                let (ahead, behind) = (p.jet(&(x + e)), p.jet(&(x - e)));
                assert!(((ahead.value - behind.value) / (2.0 * step) - jet.gradient[d]).abs() < 1e-7);
                let bend = (ahead.gradient - behind.gradient) / (2.0 * step);
                assert!((bend - jet.hessian.column(d)).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn curvature_of_a_paraboloid() {
        // p = z − (a x² + b y²)/2 has ∇·n = −(a + b) at the origin.
        let basis = PolynomialBasis::<3>::new(BasisKind::Monomial, 2);
        let coefficients: Vec<f64> = basis
            .indices()
            .iter()
            .map(|index| match index {
                [0, 0, 1] => 1.0,
                [2, 0, 0] => -0.5 * 3.0,
                [0, 2, 0] => -0.5 * 0.5,
                _ => 0.0,
            })
            .collect();
        let p = LocalPolynomial {
            basis: &basis,
            degree: 2,
            coefficients: &coefficients,
            centre: Vector::<3>::zeros(),
            scale: 1.0,
        };
        assert!((p.jet(&Vector::<3>::zeros()).curvature() + 3.5).abs() < 1e-15);
    }
}
