//! Polynomials of local coordinates t = (x − center)/scale with exact derivatives.

use super::horner::{Derivatives, derivatives};
use crate::geometry::Vector;
use crate::linear_algebra::number::{Number, add_scaled, dot, multiply_symmetric};

/// A fitted polynomial whose coefficients are borrowed.
///
/// ```
/// use meniscus::geometry::Vector;
/// use meniscus::polynomials::LocalPolynomial;
///
/// // p = 1 + 2 t₁ + 3 t₀ in nested order, around the origin.
/// let center = Vector::<2>::zeros();
/// let p = LocalPolynomial { degree: 1, coefficients: &[1.0, 2.0, 3.0], center, scale: 1.0 };
/// assert_eq!(p.jet(&Vector::<2>::new(1.0, 1.0)).gradient, [3.0, 2.0]);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct LocalPolynomial<'a, const D: usize> {
    /// Total degree for which the coefficients are laid out.
    pub degree: usize,
    /// Coefficients of the monomials of t in nested order; zero beyond the degree of the fit.
    pub coefficients: &'a [f64],
    /// Origin of the local coordinates.
    pub center: Vector<D>,
    /// Length of one local unit.
    pub scale: f64,
}

/// Value, gradient and Hessian of a polynomial p at a point x, as single numbers or lanes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet<T, const D: usize> {
    /// Value p(x).
    pub value: T,
    /// Gradient ∇p(x).
    pub gradient: [T; D],
    /// Hessian ∇∇p(x).
    pub hessian: [[T; D]; D],
}

impl<T: Number, const D: usize> Jet<T, D> {
    /// The jet from derivatives with respect to local coordinates whose unit has the length `1/inverse_scale`.
    #[inline(always)]
    pub fn from_local(local: &Derivatives<T, D>, inverse_scale: T) -> Self {
        let squared = inverse_scale * inverse_scale;
        Self {
            value: local.value,
            gradient: local.first.map(|g| g * inverse_scale),
            hessian: local.second.map(|row| row.map(|h| h * squared)),
        }
    }

    /// Slope ‖∇p‖.
    #[inline(always)]
    pub fn slope(&self) -> T {
        dot(&self.gradient, &self.gradient).sqrt()
    }

    /// Unit normal ∇p/‖∇p‖ (PCP eq. 16), outward where p increases outward.
    #[inline(always)]
    pub fn normal(&self) -> [T; D] {
        let inverse = T::splat(1.0) / self.slope();
        self.gradient.map(|g| g * inverse)
    }

    /// Curvature ∇·(∇p/‖∇p‖) = (tr H − nᵀ H n)/‖∇p‖ with the Hessian H (PCP eq. 17), in any dimension.
    #[inline(always)]
    pub fn curvature(&self) -> T {
        let n = self.normal();
        let mut trace = self.hessian[0][0];
        for d in 1..D {
            trace = trace + self.hessian[d][d];
        }
        (trace - dot(&n, &multiply_symmetric(&self.hessian, &n))) / self.slope()
    }

    /// The jet of the second-order Taylor polynomial at the displacement `way`.
    #[inline(always)]
    #[must_use]
    pub fn translated(&self, way: &[T; D]) -> Self {
        let change = multiply_symmetric(&self.hessian, way);
        let half = T::splat(0.5);
        Self {
            value: self.value + dot(&self.gradient, way) + half * dot(&change, way),
            gradient: add_scaled(&self.gradient, T::splat(1.0), &change),
            hessian: self.hessian,
        }
    }
}

impl<const D: usize> LocalPolynomial<'_, D> {
    /// Value, gradient and Hessian at the displacement `dx = x − center`.
    #[must_use]
    #[inline]
    pub fn jet(&self, dx: &Vector<D>) -> Jet<f64, D> {
        let inverse = 1.0 / self.scale;
        let t: [f64; D] = std::array::from_fn(|d| dx[d] * inverse);
        Jet::from_local(&derivatives(self.degree, |place| self.coefficients[place], &t), inverse)
    }

    /// Value at the displacement `dx = x − center`.
    #[must_use]
    pub fn value(&self, dx: &Vector<D>) -> f64 {
        self.jet(dx).value
    }
}

#[cfg(test)]
mod tests {
    use super::{LocalPolynomial, Vector};
    use crate::geometry::random::CounterRandom;
    use crate::polynomials::horner::nested_indices;

    fn check<const D: usize>(degree: usize) {
        let random = CounterRandom::new(9);
        let indices = nested_indices::<D>(degree);
        let coefficients: Vec<f64> = (0..indices.len()).map(|k| random.symmetric(&[k as i64])).collect();
        let center = Vector::<D>::zeros();
        let p = LocalPolynomial { degree, coefficients: &coefficients, center, scale: 0.7 };
        let x = Vector::<D>::from_fn(|d, _| [0.2, -0.1, 0.35][d]);
        let jet = p.jet(&x);
        let plain: f64 = indices
            .iter()
            .zip(&coefficients)
            .map(|(index, c)| c * (0..D).map(|d| (x[d] / 0.7).powi(i32::from(index[d]))).product::<f64>())
            .sum();
        assert!((jet.value - plain).abs() < 1e-14);
        let step = 1e-5;
        for d in 0..D {
            let mut e = Vector::<D>::zeros();
            e[d] = step;
            let (ahead, behind) = (p.jet(&(x + e)), p.jet(&(x - e)));
            assert!(((ahead.value - behind.value) / (2.0 * step) - jet.gradient[d]).abs() < 1e-7);
            let column = (Vector::<D>::from(ahead.gradient) - Vector::<D>::from(behind.gradient)) / (2.0 * step);
            assert!((column - Vector::<D>::from(jet.hessian[d])).norm() < 1e-6);
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        for degree in 1..=8 {
            check::<2>(degree);
            check::<3>(degree);
        }
    }

    #[test]
    fn curvature_of_a_paraboloid() {
        // p = z − (a x² + b y²)/2 has ∇·n = −(a + b) at the origin.
        let coefficients: Vec<f64> = nested_indices::<3>(2)
            .iter()
            .map(|index| match index {
                [0, 0, 1] => 1.0,
                [2, 0, 0] => -0.5 * 3.0,
                [0, 2, 0] => -0.5 * 0.5,
                _ => 0.0,
            })
            .collect();
        let p = LocalPolynomial { degree: 2, coefficients: &coefficients, center: Vector::<3>::zeros(), scale: 1.0 };
        assert!((p.jet(&Vector::<3>::zeros()).curvature() + 3.5).abs() < 1e-15);
    }
}
