//! Circle and sphere.

use super::{Surface, SurfacePoint, Vector, arc_points};
use crate::geometry::level::{BallLevel, LevelFunction};
use std::f64::consts::PI;
use std::sync::Arc;

/// All points at distance `radius` from `center`.
#[derive(Debug, Clone, PartialEq)]
pub struct Ball<const D: usize> {
    /// Center of the circle or sphere.
    pub center: Vector<D>,
    /// Radius R > 0.
    pub radius: f64,
}

impl<const D: usize> Surface<D> for Ball<D> {
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D> {
        let offset = x - self.center;
        let length = offset.norm();
        let mut normal = Vector::<D>::zeros();
        normal[0] = 1.0;
        if length > 0.0 {
            normal = offset / length;
        }
        SurfacePoint {
            distance: length - self.radius,
            point: self.center + normal * self.radius,
            normal: Some(normal),
            curvature: Some((D as f64 - 1.0) / self.radius),
        }
    }

    fn bounding_box(&self) -> (Vector<D>, Vector<D>) {
        (self.center.add_scalar(-self.radius), self.center.add_scalar(self.radius))
    }

    fn area_or_volume(&self) -> f64 {
        if D == 2 { PI * self.radius.powi(2) } else { 4.0 / 3.0 * PI * self.radius.powi(3) }
    }

    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool {
        (x - self.center).norm() <= tolerance
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        if D != 2 {
            return Vec::new();
        }
        vec![arc_points(&self.center, [self.radius; 2], 0.0, 2.0 * PI, spacing)]
    }

    fn faces(&self) -> Option<Vec<Arc<dyn LevelFunction<D>>>> {
        Some(vec![Arc::new(BallLevel { center: self.center, radius: self.radius })])
    }
}
