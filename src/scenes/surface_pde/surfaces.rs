//! Surfaces as points with exact normals and curvatures.

use crate::geometry::{Vector, fibonacci};
use crate::schemes::surface_equation::SurfacePoints;
use std::f64::consts::PI;

/// A surface about the origin by its semi-axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ellipsoid(pub Vector<3>);

impl Ellipsoid {
    /// The area of a sphere, and of an ellipsoid by Knud Thomsen's formula, to about one per cent: it sets a length alone.
    pub fn area(&self) -> f64 {
        let [a, b, c] = [self.0[0], self.0[1], self.0[2]];
        let p = 1.6075;
        let mean = ((a * b).powf(p) + (a * c).powf(p) + (b * c).powf(p)) / 3.0;
        4.0 * PI * mean.powf(1.0 / p)
    }

    /// δn, the side of the square that a point has for itself.
    pub fn spacing(&self, count: u64) -> f64 {
        (self.area() / count as f64).sqrt()
    }

    /// Stretched Fibonacci points. ∇·n = (tr A − nᵀ A n)/|A x| with A = diag(1/a²).
    pub fn points(&self, count: usize) -> SurfacePoints {
        let points: Vec<Vector<3>> = fibonacci::sphere(count).iter().map(|u| u.component_mul(&self.0)).collect();
        let shape = self.0.map(|a| 1.0 / (a * a));
        let mut found = SurfacePoints::default();
        for x in &points {
            let gradient = shape.component_mul(x);
            let steepness = gradient.norm();
            let n = gradient / steepness;
            found.curvatures.push((shape.sum() - n.dot(&shape.component_mul(&n))) / steepness);
            found.normals.push(n);
        }
        found.points = points;
        found
    }
}

#[cfg(test)]
mod tests {
    use super::{Ellipsoid, PI, Vector};
    use crate::geometry::Surface;
    use crate::geometry::surfaces;

    #[test]
    fn normals_and_curvatures_are_those_of_the_exact_surface() {
        let axes = Vector::<3>::new(1.0, 0.8, 0.75);
        let exact = surfaces::Ellipsoid { center: Vector::<3>::zeros(), semi_axes: axes };
        let found = Ellipsoid(axes).points(200);
        for ((x, n), curvature) in found.points.iter().zip(&found.normals).zip(&found.curvatures) {
            let nearest = exact.nearest(x);
            assert!(nearest.distance.abs() < 1e-12 && (nearest.normal.unwrap() - n).norm() < 1e-9);
            assert!((nearest.curvature.unwrap() - curvature).abs() < 1e-8);
        }
        assert!((Ellipsoid(Vector::<3>::repeat(2.0)).area() - 16.0 * PI).abs() < 1e-12);
    }
}
