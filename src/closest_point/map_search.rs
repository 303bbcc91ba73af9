//! The linear map under which a group of particles lies as evenly in every direction.
//!
//! Second moments of positions do not show how a lattice is stretched, because its density is the same everywhere. The
//! moments of the offsets between adjacent particles do. Two particles are adjacent when the ball with both at the ends
//! of a diameter contains no other particle (Gabriel and Sokal 1969). The inverse square root of these moments maps a
//! stretched lattice to an even one. The map is improved until the mapped offsets have the same moments in every
//! direction.

use super::local_map::{LocalMap, MappedSearch, determinant, range_of_eigenvalues, spectral};
use crate::geometry::Vector;
use crate::neighbors::{CellList, Neighbor, NeighborSearch};
use crate::polynomials::neighborhood::radius_of_count;
use nalgebra::SMatrix;

/// Particles of a group that are looked at first.
const FIRST_LOOK: usize = 8;
/// A group is even when its stretch is smaller at the first look. Moments of a jittered lattice stay below.
const EVEN: f64 = 1.4;
/// The stretch that is left in a map when its improvement ends.
const SETTLED: f64 = 1.1;
/// Smallest second moment of the positions in a neighborhood, by the largest. Below it the neighborhood shows single
/// rows of particles, and has to reach farther across them.
const FILLED: f64 = 0.4;
/// Largest factor by which a round changes the stretch.
const MOST_CHANGE: f64 = 3.0;
/// Largest stretch of a map. Beyond it neighborhoods have hundreds of particles too many in space.
const MOST_STRETCH: f64 = 16.0;
/// Largest number of improvements.
const ROUNDS: usize = 12;
/// Number of particles among which adjacent ones are looked for: those up to the second shell.
const fn looked_at(dimension: usize) -> f64 {
    if dimension == 2 { 25.0 } else { 57.0 }
}

/// What the neighborhoods of some particles show.
struct Look<const D: usize> {
    /// Mean number of particles in a neighborhood.
    count: f64,
    /// Second moments of the mapped offsets to all particles of a neighborhood.
    positions: SMatrix<f64, D, D>,
    /// Second moments of the mapped offsets to adjacent particles.
    adjacent: SMatrix<f64, D, D>,
}

impl<const D: usize> Look<D> {
    /// The factor by which the spacing of the map is too small.
    fn spacing_factor(&self) -> f64 {
        (looked_at(D) / self.count).powf(1.0 / D as f64)
    }

    /// Whether neighborhoods reach over several rows of particles in every direction.
    fn is_filled(&self) -> bool {
        let (least, most) = range_of_eigenvalues(&self.positions);
        least >= FILLED * most
    }

    /// The stretch that is left in the map, as adjacent particles show it.
    fn stretch_left(&self) -> f64 {
        let (least, most) = range_of_eigenvalues(&self.adjacent);
        (most / least.max(0.0)).sqrt()
    }

    /// The change of the metric by which the map becomes better, with the determinant 1.
    fn change(&self) -> SMatrix<f64, D, D> {
        let bound = MOST_CHANGE * MOST_CHANGE;
        let change = if self.is_filled() {
            let (_, most) = range_of_eigenvalues(&self.adjacent);
            spectral(&self.adjacent, |value| 1.0 / value.max(most / bound))
        } else {
            let (_, most) = range_of_eigenvalues(&self.positions);
            spectral(&self.positions, |value| value.max(most / bound))
        };
        change / determinant(&change).powf(1.0 / D as f64)
    }
}

/// The map under which a group of particles lies evenly, and whether it has settled.
///
/// 1. Change the spacing until neighborhoods have the wanted number of particles.
/// 2. Look at a few particles, where `is_first` says so. If they lie about as densely in every direction, the map stays.
/// 3. Improve the map with all particles of the group.
pub(super) fn map_of<const D: usize>(
    cells: &CellList<D>,
    positions: &[Vector<D>],
    particles: &[usize],
    start: LocalMap<D>,
    mut is_first: bool,
) -> (LocalMap<D>, bool) {
    let few: Vec<usize> = particles.iter().copied().step_by(particles.len().div_ceil(FIRST_LOOK).max(1)).collect();
    let mut map = start;
    let mut neighbors = Vec::new();
    for round in 0..ROUNDS {
        let seen = look(cells, positions, if is_first { &few } else { particles }, &map, &mut neighbors);
        let factor = seen.spacing_factor();
        // The number of particles of a lattice jumps when whole rows enter, so that it may never come close.
        let range = if round < ROUNDS / 3 { 0.85..=1.2 } else { 0.65..=1.5 };
        if !range.contains(&factor) {
            map = map.coarser(factor.clamp(0.25, 2.0));
            continue;
        }
        if seen.is_filled() && seen.stretch_left() < if is_first { EVEN } else { SETTLED } {
            return (map.coarser(factor), true);
        }
        is_first = false;
        let metric = map.map * seen.change() * map.map;
        match LocalMap::from_metric(&metric).filter(|next| next.stretch() <= MOST_STRETCH) {
            Some(next) => map = next,
            None => break,
        }
    }
    (map, false)
}

/// Looks at the neighborhoods of particles under a map.
fn look<const D: usize>(
    cells: &CellList<D>,
    positions: &[Vector<D>],
    particles: &[usize],
    map: &LocalMap<D>,
    neighbors: &mut Vec<Neighbor<D>>,
) -> Look<D> {
    let radius = radius_of_count::<D>(looked_at(D));
    let search = MappedSearch { cells, map };
    let (mut all, mut adjacent) = (SMatrix::<f64, D, D>::zeros(), SMatrix::<f64, D, D>::zeros());
    let (mut count, mut pairs) = (0, 0);
    for i in particles {
        search.gather(&(map.map * positions[*i]), radius, neighbors);
        count += neighbors.len();
        neighbors.retain(|neighbor| neighbor.index != *i && neighbor.r2 > 0.0);
        // The nearest neighbors rule out most pairs.
        neighbors.sort_unstable_by(|a, b| a.r2.total_cmp(&b.r2).then(a.index.cmp(&b.index)));
        for j in &*neighbors {
            all += j.dx * j.dx.transpose();
            // A lattice has particles on the spheres themselves. They do not count as inside, whatever the rounding.
            let is_inside = |k: &Neighbor<D>| k.r2 - k.dx.dot(&j.dx) < -1e-9 * j.r2;
            if !neighbors.iter().take_while(|k| k.r2 < j.r2).any(is_inside) {
                adjacent += j.dx * j.dx.transpose();
                pairs += 1;
            }
        }
    }
    Look {
        count: count as f64 / particles.len().max(1) as f64,
        positions: all / count.max(1) as f64,
        adjacent: adjacent / f64::from(pairs.max(1)),
    }
}

/// The spacing of particles that fill their bounding box.
pub(super) fn mean_spacing<const D: usize>(positions: &[Vector<D>], order: &[usize]) -> f64 {
    let (low, high) = bounding_box(positions, order);
    let sides = high - low;
    let volume: f64 = sides.iter().product();
    let mean = (volume / order.len().max(1) as f64).powf(1.0 / D as f64);
    if mean > 0.0 && mean.is_finite() { mean } else { sides.max().max(f64::MIN_POSITIVE) / order.len().max(1) as f64 }
}

/// The corners of the box around some particles.
pub(super) fn bounding_box<const D: usize>(positions: &[Vector<D>], order: &[usize]) -> (Vector<D>, Vector<D>) {
    let (low, high) = (Vector::<D>::repeat(f64::INFINITY), Vector::<D>::repeat(f64::NEG_INFINITY));
    order.iter().fold((low, high), |(low, high), i| (low.inf(&positions[*i]), high.sup(&positions[*i])))
}
