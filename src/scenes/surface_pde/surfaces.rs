//! Surfaces as points with exact normals and curvatures.

use crate::geometry::fibonacci;
use crate::geometry::surfaces::Ellipsoid;
use crate::schemes::surface_equation::SurfacePoints;
use std::f64::consts::PI;

/// The area, of an ellipsoid by Knud Thomsen's formula to about one per cent: it sets a length alone.
fn area(surface: &Ellipsoid<3>) -> f64 {
    let [a, b, c] = surface.semi_axes.into();
    let p = 1.6075;
    let mean = ((a * b).powf(p) + (a * c).powf(p) + (b * c).powf(p)) / 3.0;
    4.0 * PI * mean.powf(1.0 / p)
}

/// δn, the side of the square that a point has for itself.
pub(super) fn spacing(surface: &Ellipsoid<3>, count: u64) -> f64 {
    (area(surface) / count as f64).sqrt()
}

/// Fibonacci points of the unit sphere, stretched.
pub(super) fn points(surface: &Ellipsoid<3>, count: usize) -> SurfacePoints {
    let from_centre = fibonacci::sphere(count).into_iter().map(|u| u.component_mul(&surface.semi_axes));
    let mut found = SurfacePoints::default();
    for x in from_centre {
        let (normal, curvature) = surface.normal_and_curvature(&x);
        found.points.push(surface.center + x);
        found.normals.push(normal);
        found.curvatures.push(curvature);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::{Ellipsoid, PI, area, points};
    use crate::geometry::{Surface, Vector};

    #[test]
    fn points_lie_on_the_surface_and_know_it() {
        let surface = Ellipsoid { center: Vector::<3>::zeros(), semi_axes: Vector::<3>::new(1.0, 0.8, 0.75) };
        let found = points(&surface, 200);
        for ((x, n), curvature) in found.points.iter().zip(&found.normals).zip(&found.curvatures) {
            let nearest = surface.nearest(x);
            assert!(nearest.distance.abs() < 1e-12 && (nearest.normal.unwrap() - n).norm() < 1e-9);
            assert!((nearest.curvature.unwrap() - curvature).abs() < 1e-8);
        }
        let sphere = Ellipsoid { center: Vector::<3>::zeros(), semi_axes: Vector::<3>::repeat(2.0) };
        assert!((area(&sphere) - 16.0 * PI).abs() < 1e-12);
    }
}
