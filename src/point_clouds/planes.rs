//! Planes of least spread through the nearest neighbors of points: a first estimate of their normals.

use super::local_spacing::Nearest;
use crate::geometry::Vector;
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

/// Neighbors that a plane is laid through on a surface, and on a curve.
const NEIGHBORS: [usize; 2] = [6, 10];
/// Distance at which a neighbor counts for nothing, by that of the last one.
const CUTOFF: f64 = 1.2;

/// The plane through a neighborhood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane<const D: usize> {
    /// Unit normal, the direction of least variance. Its side is arbitrary.
    pub normal: Vector<D>,
    /// Variance along the normal by the least one in the plane.
    pub flatness: f64,
    /// Least variance in the plane by the largest one. It vanishes where the neighbors lie on a line.
    pub width: f64,
}

/// The planes through the nearest neighbors of all points, with weights (1 − r²/R²)² where R is 1.2 times the distance of
/// the last one.
#[must_use]
pub fn planes<const D: usize>(points: &[Vector<D>], nearest: &Nearest) -> Vec<Plane<D>> {
    let at = |i: usize| {
        let near = nearest.of(i);
        plane(points, i, &near[..NEIGHBORS[D - 2].min(near.len())])
    };
    (0..points.len()).into_par_iter().with_min_len(64).map(at).collect()
}

fn plane<const D: usize>(points: &[Vector<D>], i: usize, near: &[u32]) -> Plane<D> {
    let last = near.last().map_or(0.0, |j| (points[*j as usize] - points[i]).norm_squared());
    let inverse = 1.0 / (CUTOFF * CUTOFF * last).max(f64::MIN_POSITIVE);
    let mut weight = 1.0;
    let mut mean = Vector::<D>::zeros();
    let mut spread = [[0.0; 3]; 3];
    for j in near {
        let d = points[*j as usize] - points[i];
        let w = (1.0 - d.norm_squared() * inverse).powi(2);
        weight += w;
        mean += d * w;
        for a in 0..D {
            for b in 0..D {
                spread[a][b] += w * d[a] * d[b];
            }
        }
    }
    for a in 0..D {
        for b in 0..D {
            spread[a][b] -= mean[a] * mean[b] / weight;
        }
    }
    // In the plane, the third axis must not be the direction of least variance.
    let whole: f64 = (0..D).map(|a| spread[a][a]).sum();
    for (a, row) in spread.iter_mut().enumerate().skip(D) {
        row[a] = 2.0 * whole;
    }
    // Scaled, so that squares neither overflow nor vanish.
    let scale = 1.0 / whole.max(f64::MIN_POSITIVE);
    let eigen = nalgebra::Matrix3::from_fn(|a, b| spread[a][b] * scale).symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]).then(a.cmp(b)));
    let value = |rank: usize| eigen.eigenvalues[order[rank]].max(0.0);
    let normal = Vector::<D>::from_fn(|d, _| eigen.eigenvectors[(d, order[0])]);
    let width = if D == 2 { 1.0 } else { value(1) / value(2).max(f64::MIN_POSITIVE) };
    Plane { normal: normal.normalize(), flatness: value(0) / value(1).max(f64::MIN_POSITIVE), width }
}

#[cfg(test)]
mod tests {
    use super::{Nearest, Vector, planes};
    use crate::geometry::fibonacci;

    #[test]
    fn planes_are_tangent_and_lines_have_no_width() {
        let points = fibonacci::sphere(2000);
        for (x, plane) in points.iter().zip(planes(&points, &Nearest::new(&points, 12))) {
            assert!(x.dot(&plane.normal).abs() > 0.999 && plane.flatness < 0.02 && plane.width > 0.3);
        }
        let line: Vec<_> = (0..50).map(|i| Vector::<3>::new(f64::from(i), 2.0 * f64::from(i), 0.0)).collect();
        assert!(planes(&line, &Nearest::new(&line, 12)).iter().all(|plane| plane.width < 1e-12));
    }
}
