//! How well places cover chains of joined points.

use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};

/// The longest part of the chains between the nearest points of the given places, relative to the coarser spacing of the two
/// places at its ends. Without places it is infinite.
pub(super) fn largest_gap<const D: usize>(
    chains: &[Vec<Vector<D>>],
    places: &[Vector<D>],
    spacings: impl Iterator<Item = f64> + Clone,
) -> f64 {
    if places.is_empty() {
        return f64::INFINITY;
    }
    let finest = spacings.clone().fold(f64::INFINITY, f64::min);
    let hits = nearest_places(chains, places, spacings);
    let mut first = 0;
    let mut largest = 0.0_f64;
    for chain in chains {
        let hits = &hits[first..first + chain.len()];
        first += chain.len();
        largest = largest.max(largest_gap_of_chain(chain, hits, finest));
    }
    largest
}

/// For each point of the chains the spacing of the places that are nearest to it, the coarsest of them; None without any.
fn nearest_places<const D: usize>(
    chains: &[Vec<Vector<D>>],
    places: &[Vector<D>],
    spacings: impl Iterator<Item = f64>,
) -> Vec<Option<f64>> {
    let all: Vec<Vector<D>> = chains.iter().flatten().copied().collect();
    let mut cells = CellList::new(Domain::unbounded());
    let step = all.windows(2).map(|pair| (pair[1] - pair[0]).norm()).fold(f64::INFINITY, f64::min);
    cells.rebuild(all.iter().copied(), step.max(f64::MIN_POSITIVE));
    let mut hits: Vec<Option<f64>> = vec![None; all.len()];
    for (place, spacing) in places.iter().zip(spacings) {
        if let Some((nearest, _)) = cells.nearest(place, f64::INFINITY) {
            let hit = hits[nearest].get_or_insert(spacing);
            *hit = hit.max(spacing);
        }
    }
    hits
}

/// The largest gap of one chain: once around from the first hit and on to it again. A chain without a hit is one gap.
fn largest_gap_of_chain<const D: usize>(chain: &[Vector<D>], hits: &[Option<f64>], finest: f64) -> f64 {
    let mut largest = 0.0_f64;
    let mut since_hit = 0.0;
    let mut start: Option<(f64, f64)> = None;
    let mut last = finest;
    for (k, hit) in hits.iter().enumerate() {
        if k > 0 {
            since_hit += (chain[k] - chain[k - 1]).norm();
        }
        if let Some(spacing) = *hit {
            if start.is_none() {
                start = Some((since_hit, spacing));
            } else {
                largest = largest.max(since_hit / spacing.max(last));
            }
            since_hit = 0.0;
            last = spacing;
        }
    }
    let (before, spacing) = start.unwrap_or((0.0, finest));
    largest.max((since_hit + before) / spacing.max(last))
}

#[cfg(test)]
mod tests {
    use super::largest_gap;
    use crate::geometry::Vector;
    use crate::geometry::surfaces::{Ball, Surface};

    fn at(angle: f64) -> Vector<2> {
        Vector::<2>::new(0.3 + 0.5 * angle.cos(), 0.1 + 0.5 * angle.sin())
    }

    #[test]
    fn a_missing_arc_is_the_largest_gap() {
        let chains = Ball { center: Vector::<2>::new(0.3, 0.1), radius: 0.5 }.outline(0.001);
        let places: Vec<Vector<2>> = (0..100).map(|k| at(f64::from(k) * 0.05 + 0.4)).collect();
        let missing = std::f64::consts::TAU - 99.0 * 0.05;
        let gap = largest_gap(&chains, &places, std::iter::repeat_n(0.1, 100));
        assert!((gap - 5.0 * missing).abs() < 2e-2);
        // One end at a coarser level: the same distance is fewer of its spacings.
        let coarser = (0..100).map(|k| if k == 0 { 0.2 } else { 0.1 });
        assert!((largest_gap(&chains, &places, coarser) - 2.5 * missing).abs() < 1e-2);
        let start = &places[..1];
        assert!((largest_gap(&chains, start, std::iter::once(0.1)) - 5.0 * std::f64::consts::TAU).abs() < 2e-2);
        assert_eq!(largest_gap(&chains, &[], std::iter::empty()), f64::INFINITY);
    }
}
