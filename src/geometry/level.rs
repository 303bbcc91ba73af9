//! Level functions: functions of a place whose zero is a surface, negative inside.
//!
//! A level need not be a distance: its gradient at the zero may have any length but 0. Closest points are found by
//! Newton's method from values, gradients and second derivatives, which are exact to round-off where the level is smooth.

use super::Vector;

/// Second derivatives of a level, ∂²f/∂x_i∂x_j.
pub type Hessian<const D: usize> = nalgebra::SMatrix<f64, D, D>;

/// A level function at one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevelJet<const D: usize> {
    /// The value f, negative inside.
    pub value: f64,
    /// The gradient ∇f.
    pub gradient: Vector<D>,
    /// The symmetric matrix of second derivatives.
    pub hessian: Hessian<D>,
}

/// A function whose zero is a surface, with its first and second derivatives.
///
/// ```
/// use meniscus::geometry::{Vector, level::{Hessian, LevelFunction, LevelJet}};
///
/// /// x² + y² − 1
/// struct Circle;
///
/// impl LevelFunction<2> for Circle {
///     fn value(&self, x: &Vector<2>) -> f64 {
///         x.norm_squared() - 1.0
///     }
///
///     fn jet(&self, x: &Vector<2>) -> LevelJet<2> {
///         LevelJet { value: self.value(x), gradient: x * 2.0, hessian: Hessian::<2>::identity() * 2.0 }
///     }
/// }
///
/// assert_eq!(Circle.jet(&Vector::<2>::new(0.0, 1.0)).gradient[1], 2.0);
/// ```
pub trait LevelFunction<const D: usize>: Send + Sync {
    /// The value at a place.
    fn value(&self, x: &Vector<D>) -> f64;

    /// Value, gradient and second derivatives at a place, exact to round-off where the function is smooth.
    fn jet(&self, x: &Vector<D>) -> LevelJet<D>;

    /// The values at many places, in their order. `values` is as long as `points`.
    fn values(&self, points: &[Vector<D>], values: &mut [f64]) {
        for (value, x) in values.iter_mut().zip(points) {
            *value = self.value(x);
        }
    }
}

impl<const D: usize> LevelJet<D> {
    /// The unit normal ∇f/|∇f|.
    #[must_use]
    pub fn normal(&self) -> Vector<D> {
        self.gradient / self.gradient.norm()
    }

    /// The curvature ∇·n = (tr H − nᵀ H n)/|∇f| of the level set through the place.
    #[must_use]
    pub fn curvature(&self) -> f64 {
        let normal = self.normal();
        (self.hessian.trace() - normal.dot(&(self.hessian * normal))) / self.gradient.norm()
    }

    /// An upper bound of the principal curvatures of the level set: |P H P|/|∇f| with the projection P along the normal.
    #[must_use]
    pub fn sharpest_curvature(&self) -> f64 {
        let normal = self.normal();
        let along = self.hessian * normal;
        // P H P = H − n (Hn)ᵀ − (Hn) nᵀ + n (nᵀHn) nᵀ.
        let tangential = self.hessian - normal * along.transpose() - along * normal.transpose()
            + normal * normal.transpose() * normal.dot(&along);
        tangential.norm() / self.gradient.norm()
    }
}

/// The half-space n·x ≤ c behind a plane, or a straight line in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneLevel<const D: usize> {
    /// Outward unit normal n.
    pub normal: Vector<D>,
    /// Distance c of the plane from the origin, along the normal.
    pub offset: f64,
}

impl<const D: usize> PlaneLevel<D> {
    /// The plane through a point.
    #[must_use]
    pub fn through(point: &Vector<D>, normal: Vector<D>) -> Self {
        Self { normal, offset: normal.dot(point) }
    }
}

impl<const D: usize> LevelFunction<D> for PlaneLevel<D> {
    fn value(&self, x: &Vector<D>) -> f64 {
        self.normal.dot(x) - self.offset
    }

    fn jet(&self, x: &Vector<D>) -> LevelJet<D> {
        LevelJet { value: self.value(x), gradient: self.normal, hessian: Hessian::<D>::zeros() }
    }
}

/// Distance from an axis along x: a straight tube in space, a strip about a straight line in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TubeLevel<const D: usize> {
    /// A point of the axis.
    pub center: Vector<D>,
    /// Radius of the tube.
    pub radius: f64,
}

impl<const D: usize> LevelFunction<D> for TubeLevel<D> {
    fn value(&self, x: &Vector<D>) -> f64 {
        let mut across = x - self.center;
        across[0] = 0.0;
        across.norm() - self.radius
    }

    fn jet(&self, x: &Vector<D>) -> LevelJet<D> {
        let mut across = x - self.center;
        across[0] = 0.0;
        round_jet(&across, self.radius, 0)
    }
}

/// Distance from a center: a circle or a sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BallLevel<const D: usize> {
    /// The center.
    pub center: Vector<D>,
    /// The radius.
    pub radius: f64,
}

impl<const D: usize> LevelFunction<D> for BallLevel<D> {
    fn value(&self, x: &Vector<D>) -> f64 {
        (x - self.center).norm() - self.radius
    }

    fn jet(&self, x: &Vector<D>) -> LevelJet<D> {
        round_jet(&(x - self.center), self.radius, D)
    }
}

/// The jet of |offset| − radius where the level does not depend on the axis `skipped`, or on all where that is D.
fn round_jet<const D: usize>(offset: &Vector<D>, radius: f64, skipped: usize) -> LevelJet<D> {
    let length = offset.norm();
    let mut normal = Vector::<D>::zeros();
    normal[if skipped == 0 { 1 } else { 0 }] = 1.0;
    if length > 0.0 {
        normal = offset / length;
    }
    let mut across = Hessian::<D>::identity();
    if skipped < D {
        across[(skipped, skipped)] = 0.0;
    }
    let hessian = (across - normal * normal.transpose()) / length.max(f64::MIN_POSITIVE);
    LevelJet { value: length - radius, gradient: normal, hessian }
}

#[cfg(test)]
mod tests {
    use super::{BallLevel, LevelFunction, PlaneLevel, TubeLevel, Vector};

    /// Derivatives against differences, curvatures against those of the shapes.
    fn check<const D: usize>(level: &dyn LevelFunction<D>, curvature: f64) {
        let x = Vector::<D>::from_fn(|d, _| 0.3 + 0.4 * d as f64);
        let jet = level.jet(&x);
        for d in 0..D {
            let mut e = Vector::<D>::zeros();
            e[d] = 1e-5;
            let (ahead, behind) = (level.jet(&(x + e)), level.jet(&(x - e)));
            assert!((jet.gradient[d] - (ahead.value - behind.value) / 2e-5).abs() < 1e-9);
            let slope = (ahead.gradient - behind.gradient) / 2e-5;
            assert!((jet.hessian.column(d) - slope).norm() < 1e-8, "{:?} {slope:?}", jet.hessian);
        }
        assert!((jet.curvature() - curvature).abs() < 1e-12, "{} for {curvature}", jet.curvature());
        assert!(jet.sharpest_curvature() >= curvature / (D as f64 - 1.0) - 1e-12);
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let at = Vector::<3>::new(0.3, 0.7, 1.1);
        check(&PlaneLevel { normal: Vector::<2>::new(0.6, 0.8), offset: 0.1 }, 0.0);
        check(&BallLevel { center: Vector::<3>::zeros(), radius: 0.5 }, 2.0 / at.norm());
        check(&BallLevel { center: Vector::<2>::zeros(), radius: 0.5 }, 1.0 / at.fixed_rows::<2>(0).norm());
        check(&TubeLevel { center: Vector::<3>::zeros(), radius: 0.5 }, 1.0 / at.fixed_rows::<2>(1).norm());
        check(&TubeLevel { center: Vector::<2>::zeros(), radius: 0.5 }, 0.0);
    }
}
