//! Everything outside a shape.

use super::{Surface, SurfacePoint, Vector};
use crate::geometry::level::LevelFunction;
use std::sync::Arc;

/// The complement of a shape: the same surface, with inside and outside exchanged.
pub struct Complement<const D: usize> {
    /// The shape.
    pub of: Arc<dyn Surface<D>>,
}

impl<const D: usize> Surface<D> for Complement<D> {
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D> {
        let answer = self.of.nearest(x);
        SurfacePoint {
            distance: -answer.distance,
            point: answer.point,
            normal: answer.normal.map(|normal| -normal),
            curvature: answer.curvature.map(|curvature| -curvature),
        }
    }

    fn bounding_box(&self) -> (Vector<D>, Vector<D>) {
        self.of.bounding_box()
    }

    fn area_or_volume(&self) -> f64 {
        self.of.area_or_volume()
    }

    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool {
        self.of.near_medial_axis(x, tolerance)
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        let mut chains = self.of.outline(spacing);
        chains.iter_mut().for_each(|chain| chain.reverse());
        chains
    }

    fn signed_distance(&self, x: &Vector<D>) -> f64 {
        -self.of.signed_distance(x)
    }

    fn faces(&self) -> Option<Vec<Arc<dyn LevelFunction<D>>>> {
        self.of.faces()
    }
}
