//! Ellipse and ellipsoid with axes along the coordinates.
//!
//! The closest point to y is x_i = e_i² y_i / (t + e_i²), where t is the largest root of Σ (e_i y_i / (t + e_i²))² = 1
//! (Eberly 2011). The sum is convex and decreasing for t > −e_min². Newton's method therefore rises monotonically from
//! the left end of the bracket to the root.

use super::{Surface, SurfacePoint, Vector, arc_points};
use crate::geometry::level::{Hessian, LevelFunction, LevelJet};
use std::f64::consts::PI;
use std::sync::Arc;

/// The surface Σ ((x_i − c_i) / e_i)² = 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Ellipsoid<const D: usize> {
    /// Center c.
    pub center: Vector<D>,
    /// Semi-axes e, positive.
    pub semi_axes: Vector<D>,
}

impl<const D: usize> Ellipsoid<D> {
    /// √(Σ ((x_i − c_i)/e_i)²) − 1: a level-set function of this surface that is not a distance (PCP eq. 21 with the
    /// opposite sign).
    #[must_use]
    pub fn quadric(&self, x: &Vector<D>) -> f64 {
        (x - self.center).component_div(&self.semi_axes).norm() - 1.0
    }

    /// Unit normal and curvature at a point of the surface, given relative to the center.
    ///
    /// With A = diag(2/e²) the curvature is ∇·n = (tr A − nᵀ A n)/|A x|.
    #[must_use]
    pub fn normal_and_curvature(&self, foot: &Vector<D>) -> (Vector<D>, f64) {
        let e = &self.semi_axes;
        let gradient = Vector::<D>::from_fn(|i, _| 2.0 * foot[i] / (e[i] * e[i]));
        let length = gradient.norm();
        let normal = gradient / length;
        let trace: f64 = (0..D).map(|i| 2.0 / (e[i] * e[i])).sum();
        let along_normal: f64 = (0..D).map(|i| 2.0 / (e[i] * e[i]) * normal[i] * normal[i]).sum();
        (normal, (trace - along_normal) / length)
    }

    /// Gauss curvature 1/(∏ e² (Σ x_i²/e_i⁴)²) at a point of the surface, given relative to the center; 0 in the plane.
    #[must_use]
    pub fn gauss_curvature(&self, foot: &Vector<D>) -> f64 {
        let e = &self.semi_axes;
        let sum: f64 = (0..D).map(|i| (foot[i] / (e[i] * e[i])).powi(2)).sum();
        if D == 3 { 1.0 / (e.product().powi(2) * sum * sum) } else { 0.0 }
    }

    /// The closest point for a query `y` with non-negative coordinates, both relative to the center.
    fn closest_in_first_orthant(&self, y: &Vector<D>) -> Vector<D> {
        let e = &self.semi_axes;
        let shortest = e.min();
        // With s = t + e_min² the denominators t + e_i² = s + (e_i² − e_min²) lose no digits near the pole.
        let gap = Vector::<D>::from_fn(|i, _| (e[i] - shortest) * (e[i] + shortest));
        let is_positive = |i: &usize| y[*i] > 0.0;
        // Distance of the query along the shortest axes. It keeps the root away from the pole.
        let offset = (0..D).filter(|&i| gap[i] == 0.0).map(|i| y[i] * y[i]).sum::<f64>().sqrt();
        if offset == 0.0 {
            // The query lies in the plane across the shortest axes. Near the center the closest point leaves that
            // plane.
            let mut x = Vector::<D>::from_fn(|i, _| if gap[i] > 0.0 { e[i] * e[i] * y[i] / gap[i] } else { 0.0 });
            let rest = 1.0 - x.component_div(e).norm_squared();
            if rest > 0.0 {
                if let Some(i) = (0..D).find(|&i| gap[i] == 0.0) {
                    x[i] = shortest * rest.sqrt();
                }
                return x;
            }
        }
        let mut s = shortest * offset;
        for _ in 0..200 {
            let value = (0..D).filter(is_positive).map(|i| (e[i] * y[i] / (s + gap[i])).powi(2)).sum::<f64>() - 1.0;
            let slope: f64 =
                (0..D).filter(is_positive).map(|i| -2.0 * (e[i] * y[i] / (s + gap[i])).powi(2) / (s + gap[i])).sum();
            let next = s - value / slope;
            if next <= s || next.is_nan() {
                break;
            }
            s = next;
        }
        Vector::<D>::from_fn(|i, _| if y[i] > 0.0 { e[i] * e[i] * y[i] / (s + gap[i]) } else { 0.0 })
    }
}

impl<const D: usize> Surface<D> for Ellipsoid<D> {
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D> {
        let e = &self.semi_axes;
        let local = x - self.center;
        let foot = self.closest_in_first_orthant(&local.abs());
        // One scaling onto the surface removes the round-off of the root.
        let foot = foot / foot.component_div(e).norm();
        let foot = Vector::<D>::from_fn(|i, _| foot[i].copysign(local[i]));
        let (normal, curvature) = self.normal_and_curvature(&foot);
        let inside = local.component_div(e).norm_squared() < 1.0;
        let distance = (local - foot).norm();
        SurfacePoint {
            distance: if inside { -distance } else { distance },
            point: self.center + foot,
            normal: Some(normal),
            curvature: Some(curvature),
        }
    }

    fn bounding_box(&self) -> (Vector<D>, Vector<D>) {
        (self.center - self.semi_axes, self.center + self.semi_axes)
    }

    fn area_or_volume(&self) -> f64 {
        let product = self.semi_axes.product();
        if D == 2 { PI * product } else { 4.0 / 3.0 * PI * product }
    }

    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool {
        // The medial axis lies in the plane through the center across a shortest axis, within the focal ellipse.
        let local = x - self.center;
        let shortest = self.semi_axes.min();
        let flat = (0..D).any(|i| self.semi_axes[i] <= shortest && local[i].abs() <= tolerance);
        let focal_square = (0..D)
            .filter(|&i| self.semi_axes[i] > shortest)
            .map(|i| {
                let focal = (self.semi_axes[i].powi(2) - shortest * shortest) / self.semi_axes[i];
                (local[i].abs() - tolerance).max(0.0) / focal
            })
            .map(|r| r * r)
            .sum::<f64>();
        let beside = (0..D).all(|i| self.semi_axes[i] > shortest || local[i].abs() <= tolerance);
        flat && beside && focal_square <= 1.0
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        if D != 2 {
            return Vec::new();
        }
        vec![arc_points(&self.center, [self.semi_axes[0], self.semi_axes[1]], 0.0, 2.0 * PI, spacing)]
    }

    fn faces(&self) -> Option<Vec<Arc<dyn LevelFunction<D>>>> {
        Some(vec![Arc::new(self.clone())])
    }
}

/// The level Σ ((x_i − c_i)/e_i)² − 1, which is not a distance.
impl<const D: usize> LevelFunction<D> for Ellipsoid<D> {
    fn value(&self, x: &Vector<D>) -> f64 {
        (x - self.center).component_div(&self.semi_axes).norm_squared() - 1.0
    }

    fn jet(&self, x: &Vector<D>) -> LevelJet<D> {
        let slopes = self.semi_axes.map(|e| 2.0 / (e * e));
        LevelJet {
            value: self.value(x),
            gradient: (x - self.center).component_mul(&slopes),
            hessian: Hessian::<D>::from_diagonal(&slopes),
        }
    }
}
