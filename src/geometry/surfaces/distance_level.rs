//! The distance from a smooth surface as a level function, for closest points on parts of the surface.

use super::{Surface, SurfacePoint, Vector};
use crate::geometry::level::{Hessian, LevelFunction, LevelJet};
use std::sync::Arc;

/// Offset of the places by whose normals second derivatives are found in space, relative to the extent of the surface.
const OFFSET: f64 = 1e-5;

/// The signed distance from a surface without edges.
///
/// Value and gradient are exact. In space, second derivatives come from normals nearby: surfaces do not tell their shape
/// tensor. They steer Newton's method, and its result depends on values and gradients alone.
pub(super) struct DistanceLevel<const D: usize> {
    surface: Arc<dyn Surface<D>>,
    offset: f64,
}

impl<const D: usize> DistanceLevel<D> {
    pub fn new(surface: Arc<dyn Surface<D>>) -> Self {
        let (low, high) = surface.bounding_box();
        Self { offset: OFFSET * (high - low).max(), surface }
    }

    /// The gradient of the distance: the normal, or at an edge the way from it.
    fn gradient(&self, x: &Vector<D>) -> Vector<D> {
        gradient(x, &self.surface.nearest(x))
    }
}

fn gradient<const D: usize>(x: &Vector<D>, answer: &SurfacePoint<D>) -> Vector<D> {
    answer.normal.unwrap_or_else(|| (x - answer.point) / answer.distance)
}

impl<const D: usize> LevelFunction<D> for DistanceLevel<D> {
    fn value(&self, x: &Vector<D>) -> f64 {
        self.surface.signed_distance(x)
    }

    fn jet(&self, x: &Vector<D>) -> LevelJet<D> {
        let answer = self.surface.nearest(x);
        let gradient = gradient(x, &answer);
        let hessian = if D == 2 {
            // κ/(1 + κd) along the tangent.
            let curvature = answer.curvature.unwrap_or(0.0);
            let along = curvature / (1.0 + curvature * answer.distance);
            (Hessian::<D>::identity() - gradient * gradient.transpose()) * along
        } else {
            let column = |d: usize| {
                let mut e = Vector::<D>::zeros();
                e[d] = self.offset;
                (self.gradient(&(x + e)) - self.gradient(&(x - e))) / (2.0 * self.offset)
            };
            let columns: [Vector<D>; D] = std::array::from_fn(column);
            let matrix = Hessian::<D>::from_columns(&columns);
            (matrix + matrix.transpose()) * 0.5
        };
        LevelJet { value: answer.distance, gradient, hessian }
    }
}
