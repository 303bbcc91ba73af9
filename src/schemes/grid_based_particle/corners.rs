//! Corners and edges that open at once. With a given speed particles of all the directions in between stand in one place, and
//! become an arc with the first motion; by curvature one of the mean direction is enough for fits to see the turn.

use super::grid::Grid;
use super::system::for_each_near;
use crate::geometry::{Surface, Vector};
use std::cmp::Ordering;

/// Places that see a corner from this far, in spacings, tell the directions.
const RING: [f64; 2] = [0.6, 0.85];
/// Places per spacing, on a curve and on a surface: about ten directions in a right angle.
const PLACES: [f64; 2] = [6.0, 4.0];
/// Any corner that opens widely is seen by a grid point within so many spacings.
const SIGHT: f64 = 2.5;

/// Places and normals, those of one place as one with their mean direction.
pub(super) fn of_mean_direction<const D: usize>(mut fans: Vec<(Vector<D>, Vector<D>)>) -> Vec<(Vector<D>, Vector<D>)> {
    let order = |a: &Vector<D>, b: &Vector<D>| {
        a.iter().zip(b.iter()).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
    };
    fans.sort_by(|a, b| order(&a.0, &b.0));
    let of_one_place = fans.chunk_by(|a, b| a.0 == b.0);
    let mean = |fan: &[(Vector<D>, Vector<D>)]| {
        let sum: Vector<D> = fan.iter().map(|(_, normal)| normal).sum();
        sum.try_normalize(0.0).map(|normal| (fan[0].0, normal))
    };
    of_one_place.filter_map(mean).collect()
}

/// Calls with the place and the normal of every particle of the fans of a surface. `opens` says it of a signed distance from
/// which a corner is the closest point.
pub(super) fn for_each_fan<const D: usize>(
    surface: &dyn Surface<D>,
    (grid, level): (&Grid, u32),
    opens: impl Fn(f64) -> bool,
    mut visit: impl FnMut(Vector<D>, Vector<D>),
) {
    let spacing = grid.spacing_at(level);
    let sees_corner = |place: &Vector<D>| {
        let exact = surface.nearest(place);
        (exact.normal.is_none() && opens(exact.distance)).then_some(exact)
    };
    let mut has_corner = false;
    for_each_near(surface, SIGHT * spacing, (grid, level), |_, place| {
        has_corner = has_corner || sees_corner(&place).is_some();
    });
    if !has_corner {
        return;
    }
    let fine = Grid { spacing: spacing / PLACES[D - 2] };
    for_each_near(surface, RING[1] * spacing, (&fine, 0), |_, place| {
        if let Some(exact) = sees_corner(&place).filter(|exact| exact.distance.abs() >= RING[0] * spacing) {
            let way = (place - exact.point) * exact.distance.signum();
            if let Some(normal) = way.try_normalize(0.0) {
                visit(exact.point, normal);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::for_each_fan;
    use crate::geometry::surfaces::{Ball, Cuboid};
    use crate::geometry::{Surface, Vector};
    use crate::schemes::grid_based_particle::Grid;

    fn fans(surface: &dyn Surface<2>, spacing: f64) -> Vec<(Vector<2>, Vector<2>)> {
        let mut found = Vec::new();
        for_each_fan(surface, (&Grid { spacing }, 0), |distance| distance > 0.0, |x, n| found.push((x, n)));
        found
    }

    /// However the corner lies in the grid: on a grid point, beside one, between them.
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
    fn a_circle_has_none() {
        assert!(fans(&Ball { center: Vector::<2>::zeros(), radius: 0.3 }, 1.0 / 64.0).is_empty());
    }
}
