//! Unit normals of a surface that is known by points alone.
//!
//! A normal is the direction of least variance of the neighbors of its point. Its sign is propagated along the spanning
//! tree whose edges turn least.

use super::least_turn::Edge;
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefIterator, ParallelIterator};
use std::collections::BinaryHeap;

/// A point has too few neighbors to determine a plane.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("point {point} at {at:?} has {neighbors} neighbors within {radius:.4e}, which is too few for a tangent plane")]
pub struct NoPlane {
    /// Index of the point.
    pub point: usize,
    /// Position of the point.
    pub at: Vec<f64>,
    /// Number of neighbors.
    pub neighbors: usize,
    /// Radius of the search, a length.
    pub radius: f64,
}

/// Estimates unit normals from the neighbors within `radius`.
///
/// Normals are oriented consistently on each connected part. They point outward where the part is farthest along the
/// last axis.
///
/// # Errors
/// [`NoPlane`] names the first point with too few neighbors.
///
/// ```
/// use meniscus::{geometry::fibonacci, point_clouds::normals};
///
/// let points = fibonacci::sphere(500);
/// let normals = normals::estimate(&points, 0.4).unwrap();
/// assert!(points.iter().zip(&normals).all(|(x, n)| x.dot(n) > 0.99));
/// ```
pub fn estimate<const D: usize>(points: &[Vector<D>], radius: f64) -> Result<Vec<Vector<D>>, NoPlane> {
    let mut cells = CellList::new(Domain::unbounded());
    cells.rebuild(points.iter().copied(), radius);
    let found: Result<Vec<Vector<D>>, NoPlane> =
        points.par_iter().with_min_len(64).enumerate().map(|(i, x)| plane(&cells, i, x, radius)).collect();
    let mut normals = found?;
    orient(points, &cells, radius, &mut normals);
    Ok(normals)
}

/// The direction of least variance of the neighbors of point `i` at `x`, weighted by (1 − r²/R²)² with R = `radius`.
pub(super) fn plane<const D: usize>(
    cells: &CellList<D>,
    i: usize,
    x: &Vector<D>,
    radius: f64,
) -> Result<Vector<D>, NoPlane> {
    let (mut weight, mut count) = (0.0, 0);
    let mut mean = Vector::<D>::zeros();
    let mut spread = [[0.0; 3]; 3];
    cells.for_each_within(x, radius, |_, dx, square| {
        let w = (1.0 - square / (radius * radius)).powi(2);
        weight += w;
        count += 1;
        mean += dx * w;
        for a in 0..D {
            for b in 0..D {
                spread[a][b] += w * dx[a] * dx[b];
            }
        }
    });
    if count < D + 1 || weight.is_nan() {
        return Err(NoPlane { point: i, at: x.iter().copied().collect(), neighbors: count - 1, radius });
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
    let matrix = nalgebra::Matrix3::from_fn(|a, b| spread[a][b]);
    let eigen = matrix.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    Ok(Vector::<D>::from_fn(|d, _| eigen.eigenvectors[(d, least)]).normalize())
}

/// Orients normals consistently, along the edges that turn least first.
fn orient<const D: usize>(points: &[Vector<D>], cells: &CellList<D>, radius: f64, normals: &mut [Vector<D>]) {
    let mut order: Vec<usize> = (0..points.len()).collect();
    // Each part starts at its highest point, where the outward direction is up.
    order.sort_by(|a, b| points[*b][D - 1].total_cmp(&points[*a][D - 1]).then(a.cmp(b)));
    let mut is_done = vec![false; points.len()];
    let mut heap = BinaryHeap::new();
    for start in order {
        if is_done[start] {
            continue;
        }
        if normals[start][D - 1] < 0.0 {
            normals[start] = -normals[start];
        }
        is_done[start] = true;
        let mut at = Some(start);
        while let Some(from) = at {
            cells.for_each_within(&points[from], radius, |to, _, _| {
                if !is_done[to] {
                    let turn = 1.0 - normals[from].dot(&normals[to]).abs();
                    heap.push(Edge { turn, from: from as u32, to: to as u32 });
                }
            });
            at = None;
            while let Some(Edge { from, to, .. }) = heap.pop() {
                let (from, to) = (from as usize, to as usize);
                if !is_done[to] {
                    if normals[from].dot(&normals[to]) < 0.0 {
                        normals[to] = -normals[to];
                    }
                    is_done[to] = true;
                    at = Some(to);
                    break;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Vector, estimate};
    use crate::geometry::fibonacci;

    #[test]
    fn normals_of_a_sphere_point_outward() {
        let points = fibonacci::sphere(2000);
        let radius = 2.5 * (4.0 * std::f64::consts::PI / 2000.0_f64).sqrt();
        let normals = estimate(&points, radius).unwrap();
        assert!(points.iter().zip(&normals).all(|(x, n)| x.dot(n) > 0.999));
    }

    #[test]
    fn normals_of_a_circle_point_outward() {
        let points: Vec<_> =
            (0..100).map(|i| f64::from(i) * 0.0628).map(|a| Vector::<2>::new(a.cos(), a.sin())).collect();
        let normals = estimate(&points, 0.2).unwrap();
        assert!(points.iter().zip(&normals).all(|(x, n)| x.dot(n) > 0.99));
    }

    #[test]
    fn an_isolated_point_is_named() {
        let mut points = fibonacci::sphere(200);
        points.push(Vector::<3>::new(9.0, 0.0, 0.0));
        let failed = estimate(&points, 0.5).unwrap_err();
        assert_eq!((failed.point, failed.neighbors), (200, 0));
    }
}
