//! Torus about the z axis (3D only).

use super::{Surface, SurfacePoint, Vector};
use std::f64::consts::PI;

/// All points at the distance `minor_radius` from the circle of radius `major_radius` in the plane z = c_z.
#[derive(Debug, Clone, PartialEq)]
pub struct Torus {
    /// Center c of the torus.
    pub center: Vector<3>,
    /// Radius R of the core circle.
    pub major_radius: f64,
    /// Radius r < R of the tube.
    pub minor_radius: f64,
}

impl Torus {
    /// Gauss curvature cos θ/(r ρ) at a point of the surface, where ρ = R + r cos θ is the distance from the axis.
    #[must_use]
    pub fn gauss_curvature(&self, x: &Vector<3>) -> f64 {
        let local = x - self.center;
        let rho = local[0].hypot(local[1]);
        (rho - self.major_radius) / (self.minor_radius * self.minor_radius * rho)
    }
}

impl Surface<3> for Torus {
    fn nearest(&self, x: &Vector<3>) -> SurfacePoint<3> {
        let local = x - self.center;
        let rho = local[0].hypot(local[1]);
        let outward = if rho > 0.0 { Vector::<3>::new(local[0] / rho, local[1] / rho, 0.0) } else { Vector::<3>::x() };
        let core = outward * self.major_radius;
        let offset = local - core;
        let length = offset.norm();
        let normal = if length > 0.0 { offset / length } else { outward };
        let cosine = normal.dot(&outward);
        let around = cosine / (self.major_radius + self.minor_radius * cosine);
        SurfacePoint {
            distance: length - self.minor_radius,
            point: self.center + core + normal * self.minor_radius,
            normal: Some(normal),
            curvature: Some(1.0 / self.minor_radius + around),
        }
    }

    fn bounding_box(&self) -> (Vector<3>, Vector<3>) {
        let outer_radius = self.major_radius + self.minor_radius;
        let half = Vector::<3>::new(outer_radius, outer_radius, self.minor_radius);
        (self.center - half, self.center + half)
    }

    fn area_or_volume(&self) -> f64 {
        2.0 * PI * PI * self.major_radius * self.minor_radius * self.minor_radius
    }

    fn near_medial_axis(&self, x: &Vector<3>, tolerance: f64) -> bool {
        let local = x - self.center;
        let rho = local[0].hypot(local[1]);
        rho <= tolerance || (rho - self.major_radius).hypot(local[2]) <= tolerance
    }

    fn outline(&self, _spacing: f64) -> Vec<Vec<Vector<3>>> {
        Vec::new()
    }
}
