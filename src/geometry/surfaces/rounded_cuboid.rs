//! Box with rounded edges and corners: all points within `corner_radius` of a smaller box.

use super::{Cuboid, Surface, SurfacePoint, Vector, arc_points, join, line_points};
use std::f64::consts::{FRAC_PI_2, PI};

/// The Minkowski sum of a box and a ball.
#[derive(Debug, Clone, PartialEq)]
pub struct RoundedCuboid<const D: usize> {
    /// Center of the box.
    pub center: Vector<D>,
    /// Outer edge lengths, each above twice the corner radius.
    pub size: Vector<D>,
    /// Radius of the rounded edges and corners, positive.
    pub corner_radius: f64,
}

impl<const D: usize> Surface<D> for RoundedCuboid<D> {
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D> {
        let half = self.size * 0.5;
        let core = half.add_scalar(-self.corner_radius);
        let local = x - self.center;
        let clamped = Vector::<D>::from_fn(|d, _| local[d].clamp(-core[d], core[d]));
        let beyond = (0..D).filter(|&d| local[d].abs() > core[d]).count();
        if beyond == 0 {
            let (axis, depth) = Cuboid::<D>::nearest_face(&half, &local);
            let mut foot = local;
            foot[axis] = half[axis].copysign(local[axis]);
            let mut normal = Vector::<D>::zeros();
            normal[axis] = 1.0_f64.copysign(local[axis]);
            return SurfacePoint {
                distance: depth,
                point: self.center + foot,
                normal: Some(normal),
                curvature: Some(0.0),
            };
        }
        let offset = local - clamped;
        let length = offset.norm();
        let normal = offset / length;
        SurfacePoint {
            distance: length - self.corner_radius,
            point: self.center + clamped + normal * self.corner_radius,
            normal: Some(normal),
            curvature: Some((beyond as f64 - 1.0) / self.corner_radius),
        }
    }

    fn bounding_box(&self) -> (Vector<D>, Vector<D>) {
        (self.center - self.size * 0.5, self.center + self.size * 0.5)
    }

    fn area_or_volume(&self) -> f64 {
        // Steiner's formula for the sum of the inner box and a ball.
        let core = self.size.add_scalar(-2.0 * self.corner_radius);
        let r = self.corner_radius;
        if D == 2 {
            core.product() + 2.0 * core.sum() * r + PI * r * r
        } else {
            let faces = core[0] * core[1] + core[1] * core[2] + core[2] * core[0];
            core.product() + 2.0 * faces * r + PI * core.sum() * r * r + 4.0 / 3.0 * PI * r * r * r
        }
    }

    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool {
        let core = Cuboid { center: self.center, size: self.size.add_scalar(-2.0 * self.corner_radius) };
        let answer = core.nearest(x);
        answer.distance <= tolerance && (answer.distance.abs() <= tolerance || core.near_medial_axis(x, tolerance))
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        if D != 2 {
            return Vec::new();
        }
        let r = self.corner_radius;
        let core = |sx: f64, sy: f64| {
            let mut c = self.center;
            c[0] += sx * (0.5 * self.size[0] - r);
            c[1] += sy * (0.5 * self.size[1] - r);
            c
        };
        let centers = [core(1.0, -1.0), core(1.0, 1.0), core(-1.0, 1.0), core(-1.0, -1.0)];
        let mut pieces = Vec::new();
        for k in 0..4 {
            let from = (k as f64 - 1.0) * FRAC_PI_2;
            let arc = arc_points(&centers[k], [r, r], from, from + FRAC_PI_2, spacing);
            let next = arc_points(&centers[(k + 1) % 4], [r, r], from + FRAC_PI_2, from + PI, spacing);
            let side = line_points(&arc[arc.len() - 1], &next[0], spacing);
            pieces.push(arc);
            pieces.push(side);
        }
        vec![join(pieces)]
    }
}
