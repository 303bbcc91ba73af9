//! Whether a cloud is stretched near its surface, from a few places of it.

use super::local_map::{LocalMap, MappedSearch, determinant};
use super::map_search::{map_of, mean_spacing};
use crate::geometry::Vector;
use crate::neighbors::{CellList, NeighborSearch};
use crate::polynomials::neighborhood::radius_of_count;
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};

/// Stretch and spacing of a cloud near the zero of its level.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// Stretch at each of the places, in increasing order.
    stretches: Vec<f64>,
    /// Median of the mean spacing: the edge of a square or cube for each particle.
    pub mean_spacing: f64,
}

/// Places that are looked at.
const PLACES: usize = 64;
/// Particles around a place.
const GROUP: f64 = 48.0;
/// A cloud is stretched when the median stretch at its surface is at least this. Even lattices have 1.
const STRETCHED: f64 = 1.4;
/// It is stretched in a part when this share of the places is stretched by [`STRETCHED_PART`]. Single places of
/// even lattices reach 1.7 by chance.
const PART: f64 = 0.1;
const STRETCHED_PART: f64 = 2.0;

impl Stretch {
    /// The stretch of particles that are sorted into cells, near the smallest magnitudes of their level.
    #[must_use]
    pub fn new<const D: usize>(cells: &CellList<D>, positions: &[Vector<D>], level: &[f64]) -> Self {
        let mut order: Vec<usize> = (0..positions.len()).collect();
        let even = LocalMap::even(mean_spacing(positions, &order));
        // A surface has about n^(1 − 1/D) particles beside it.
        let near = (positions.len() as f64).powf(1.0 - 1.0 / D as f64) as usize;
        let near = near.max(PLACES).min(positions.len());
        if near < order.len() {
            order.select_nth_unstable_by(near, |a, b| level[*a].abs().total_cmp(&level[*b].abs()).then(a.cmp(b)));
        }
        order.truncate(near);
        order.sort_unstable();
        let places: Vec<usize> = order.iter().copied().step_by(near.div_ceil(PLACES).max(1)).collect();
        let maps: Vec<LocalMap<D>> = places.par_iter().map(|place| map_at(cells, positions, *place, even)).collect();
        let sorted = |length: &dyn Fn(&LocalMap<D>) -> f64| {
            let mut lengths: Vec<f64> = maps.iter().map(length).collect();
            lengths.sort_by(f64::total_cmp);
            lengths
        };
        let spacings = sorted(&|map| determinant(&map.inverse).powf(1.0 / D as f64));
        Self { stretches: sorted(&LocalMap::stretch), mean_spacing: median(&spacings) }
    }

    /// Whether fits have to follow the stretch.
    #[must_use]
    pub fn is_large(&self) -> bool {
        let part = self.stretches.iter().filter(|stretch| **stretch >= STRETCHED_PART).count();
        median(&self.stretches) >= STRETCHED || part as f64 > PART * self.stretches.len() as f64
    }
}

fn median(sorted: &[f64]) -> f64 {
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// The map of the particles around a particle.
fn map_at<const D: usize>(
    cells: &CellList<D>,
    positions: &[Vector<D>],
    place: usize,
    even: LocalMap<D>,
) -> LocalMap<D> {
    let search = MappedSearch { cells, map: &even };
    let mut group = Vec::new();
    search.for_each_within(&(even.map * positions[place]), radius_of_count::<D>(GROUP), |j, _, _| group.push(j));
    map_of(cells, positions, &group, even, true).0
}
