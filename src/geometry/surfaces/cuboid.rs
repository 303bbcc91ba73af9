//! Box (rectangle in 2D) with faces perpendicular to the coordinate axes.

use super::{Surface, SurfacePoint, Vector, join, line_points};
use crate::geometry::level::{LevelFunction, PlaneLevel};
use std::sync::Arc;

/// The box |x_i − c_i| ≤ size_i / 2.
#[derive(Debug, Clone, PartialEq)]
pub struct Cuboid<const D: usize> {
    /// Center c.
    pub center: Vector<D>,
    /// Full edge lengths, positive.
    pub size: Vector<D>,
}

impl<const D: usize> Cuboid<D> {
    /// Axis of the face nearest to an inner point, and the signed distance ≤ 0 from it.
    ///
    /// `half` are half the edge lengths, `local` is the position relative to the center.
    pub(super) fn nearest_face(half: &Vector<D>, local: &Vector<D>) -> (usize, f64) {
        let mut axis = 0;
        for d in 1..D {
            if local[d].abs() - half[d] > local[axis].abs() - half[axis] {
                axis = d;
            }
        }
        (axis, local[axis].abs() - half[axis])
    }
}

impl<const D: usize> Surface<D> for Cuboid<D> {
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D> {
        let half = self.size * 0.5;
        let local = x - self.center;
        let clamped = Vector::<D>::from_fn(|d, _| local[d].clamp(-half[d], half[d]));
        let outside = (0..D).filter(|&d| local[d].abs() > half[d]).count();
        let (axis, depth) = Self::nearest_face(&half, &local);
        let mut foot = clamped;
        let distance = if outside == 0 {
            foot[axis] = half[axis].copysign(local[axis]);
            depth
        } else {
            (local - clamped).norm()
        };
        let mut face = Vector::<D>::zeros();
        face[axis] = 1.0_f64.copysign(local[axis]);
        let on_edge = (0..D).filter(|&d| foot[d].abs() >= half[d]).count() > 1;
        SurfacePoint {
            distance,
            point: self.center + foot,
            normal: (!on_edge).then_some(face),
            curvature: (!on_edge).then_some(0.0),
        }
    }

    fn bounding_box(&self) -> (Vector<D>, Vector<D>) {
        (self.center - self.size * 0.5, self.center + self.size * 0.5)
    }

    fn area_or_volume(&self) -> f64 {
        self.size.product()
    }

    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool {
        let half = self.size * 0.5;
        let local = x - self.center;
        let (axis, depth) = Self::nearest_face(&half, &local);
        // Inside, two faces are equally near on the medial axis. Outside, the closest point is unique.
        let second = (0..D).filter(|&d| d != axis).map(|d| local[d].abs() - half[d]).fold(f64::NEG_INFINITY, f64::max);
        depth < 0.0 && (depth - second <= tolerance || local[axis].abs() <= tolerance)
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        if D != 2 {
            return Vec::new();
        }
        let corner = |sx: f64, sy: f64| {
            let mut c = self.center;
            c[0] += 0.5 * sx * self.size[0];
            c[1] += 0.5 * sy * self.size[1];
            c
        };
        let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        vec![join((0..4).map(|k| line_points(&corners[k], &corners[(k + 1) % 4], spacing)).collect())]
    }

    fn faces(&self) -> Option<Vec<Arc<dyn LevelFunction<D>>>> {
        let face = |k: usize| -> Arc<dyn LevelFunction<D>> {
            let mut normal = Vector::<D>::zeros();
            normal[k / 2] = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
            Arc::new(PlaneLevel::through(&(self.center + normal * (0.5 * self.size[k / 2])), normal))
        };
        Some((0..2 * D).map(face).collect())
    }
}
