//! Corners and edges that open at once. With a given speed, particles of all directions in between start at one position and
//! become an arc with the first motion. Under motion by curvature one particle of the mean direction is enough for the fits.

use super::tube::{GridLevel, for_each_near};
use crate::geometry::{Surface, Vector};
use std::cmp::Ordering;

/// Tuning constants of the search for corners. Lengths are in spacings.
struct CornerTuning {
    /// Range of distances from a corner of the positions that tell its directions.
    ring: [f64; 2],
    /// Positions per spacing on that ring, on a curve and on a surface: about ten directions in a right angle.
    positions_per_spacing: [f64; 2],
    /// Radius within which some grid point finds each corner that opens widely.
    sight: f64,
}

/// With directions from the grid points near a corner instead, squares placed on grid points stood still and opened without
/// arcs (docs/results/front-notes.md, Corners and meetings).
const TUNING: CornerTuning = CornerTuning { ring: [0.6, 0.85], positions_per_spacing: [6.0, 4.0], sight: 2.5 };

/// Replaces the fan at each position by one particle of the mean direction.
pub(super) fn merge_fans<const D: usize>(mut fans: Vec<(Vector<D>, Vector<D>)>) -> Vec<(Vector<D>, Vector<D>)> {
    let order = |a: &Vector<D>, b: &Vector<D>| {
        a.iter().zip(b.iter()).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
    };
    fans.sort_by(|a, b| order(&a.0, &b.0));
    let of_one_position = fans.chunk_by(|a, b| a.0 == b.0);
    let mean = |fan: &[(Vector<D>, Vector<D>)]| {
        let sum: Vector<D> = fan.iter().map(|(_, normal)| normal).sum();
        sum.try_normalize(0.0).map(|normal| (fan[0].0, normal))
    };
    of_one_position.filter_map(mean).collect()
}

/// Calls `visit` with the position and the normal of each particle of the fans of a surface. `opens` tells whether a corner
/// opens that is the closest point at a signed distance.
pub(super) fn for_each_fan<const D: usize>(
    surface: &dyn Surface<D>,
    place: GridLevel,
    opens: impl Fn(f64) -> bool,
    mut visit: impl FnMut(Vector<D>, Vector<D>),
) {
    let spacing = place.spacing();
    let sees_corner = |x: &Vector<D>| {
        let exact = surface.nearest(x);
        (exact.normal.is_none() && opens(exact.distance)).then_some(exact)
    };
    let mut has_corner = false;
    for_each_near(surface, TUNING.sight * spacing, place, |_, x| {
        has_corner = has_corner || sees_corner(&x).is_some();
    });
    if !has_corner {
        return;
    }
    let fine = GridLevel::with_spacing(spacing / TUNING.positions_per_spacing[D - 2]);
    for_each_near(surface, TUNING.ring[1] * spacing, fine, |_, x| {
        if let Some(exact) = sees_corner(&x).filter(|exact| exact.distance.abs() >= TUNING.ring[0] * spacing) {
            let direction = (x - exact.point) * exact.distance.signum();
            if let Some(normal) = direction.try_normalize(0.0) {
                visit(exact.point, normal);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::{for_each_fan, merge_fans};
    use crate::geometry::surfaces::{Ball, Cuboid};
    use crate::geometry::{Surface, Vector};
    use crate::schemes::grid_based_particle::tube::GridLevel;

    fn fans(surface: &dyn Surface<2>, spacing: f64) -> Vec<(Vector<2>, Vector<2>)> {
        let mut found = Vec::new();
        for_each_fan(surface, GridLevel::with_spacing(spacing), |distance| distance > 0.0, |x, n| found.push((x, n)));
        found
    }

    /// Corners on a grid point, next to one, and between grid points.
    #[test]
    fn every_corner_of_a_square_has_all_directions() {
        for size in [0.5, 0.503, 0.51, 0.52] {
            let square = Cuboid { center: Vector::<2>::zeros(), size: Vector::<2>::repeat(size) };
            let found = fans(&square, 1.0 / 64.0);
            let mut angles: Vec<f64> = found.iter().map(|(_, n)| n[1].atan2(n[0])).collect();
            angles.sort_by(f64::total_cmp);
            let widest = angles.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
            assert!(widest < 0.35, "{size}: {widest}");
            assert!(found.iter().all(|(x, n)| (x[0].abs() - 0.5 * size).abs() < 1e-15 && x[0] * n[0] >= 0.0));
            assert!(found.len() < 100, "{}", found.len());
        }
    }

    #[test]
    fn a_merged_fan_has_the_mean_direction() {
        let square = Cuboid { center: Vector::<2>::zeros(), size: Vector::<2>::repeat(0.503) };
        let merged = merge_fans(fans(&square, 1.0 / 64.0));
        assert_eq!(merged.len(), 4);
        for (x, n) in merged {
            assert!((n.norm() - 1.0).abs() < 1e-14 && n.dot(&x.normalize()) > 0.99, "{x} {n}");
        }
    }

    #[test]
    fn a_circle_has_no_corners() {
        assert!(fans(&Ball { center: Vector::<2>::zeros(), radius: 0.3 }, 1.0 / 64.0).is_empty());
    }
}
