//! The metric of a cloud: how its particles are stretched near each place.
//!
//! Second moments of positions do not show how a lattice is stretched, because its density is the same everywhere. The
//! moments of the offsets between adjacent particles do. Two particles are adjacent when the ball with both at the ends
//! of a diameter contains no other particle (Gabriel and Sokal 1969). The inverse square root of these moments maps a
//! stretched lattice to an even one. The map is improved until the mapped offsets have the same moments in every
//! direction.
//!
//! The cloud is split into patches of some dozens of particles, each with one map.

use super::local_map::{LocalMap, MappedSearch, determinant, range_of_eigenvalues, spectral};
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, Neighbor, NeighborSearch};
use crate::parallel::{Interrupt, Interrupted};
use crate::polynomials::neighborhood::radius_of_count;
use nalgebra::SMatrix;
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};
use std::ops::Range;

/// Patches of a cloud, and the map of each.
#[derive(Debug, Clone)]
pub struct CloudMetric<const D: usize> {
    /// Indices of the particles, patch by patch.
    order: Vec<usize>,
    /// First slot of each patch in `order`, and the number of particles at the end.
    starts: Vec<usize>,
    maps: Vec<LocalMap<D>>,
}

/// Largest number of particles of a patch.
const PATCH: usize = 64;
/// Particles of a patch that are looked at first.
const FIRST_LOOK: usize = 8;
/// A patch is even when its stretch is smaller at the first look. Moments of a jittered lattice stay below.
const EVEN: f64 = 1.4;
/// The stretch that is left in a map when its improvement ends.
const SETTLED: f64 = 1.1;
/// Largest factor by which a round changes the stretch. The first neighborhoods may show one row of particles alone.
const MOST_CHANGE: f64 = 4.0;
/// Largest stretch of a map. Beyond it neighborhoods have hundreds of particles too many in space.
const MOST_STRETCH: f64 = 16.0;
/// Largest number of improvements.
const ROUNDS: usize = 12;
/// A cloud is stretched when this share of its patches at the surface is, by at least [`STRETCHED`].
const STRETCHED_SHARE: f64 = 0.05;
/// Fits with one radius lose accuracy from this stretch on (measured: 1.5 costs less than a factor of two).
const STRETCHED: f64 = 1.5;

/// Number of particles among which adjacent ones are looked for: those up to the second shell.
const fn looked_at(dimension: usize) -> f64 {
    if dimension == 2 { 25.0 } else { 57.0 }
}

impl<const D: usize> CloudMetric<D> {
    /// The metric of a cloud with a level.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn new(positions: &[Vector<D>], interrupt: &Interrupt) -> Result<Self, Interrupted> {
        let mut order: Vec<usize> = (0..positions.len()).collect();
        let mut starts = vec![0];
        split(positions, &mut order, 0, &mut starts);
        let mut cells = CellList::new(Domain::unbounded());
        let spacing = mean_spacing(positions, &order);
        cells.rebuild(positions.iter().copied(), 2.0 * spacing);
        let ranges: Vec<Range<usize>> = starts.windows(2).map(|pair| pair[0]..pair[1]).collect();
        let maps = ranges
            .into_par_iter()
            .with_max_len(1)
            .map(|range| {
                let start = LocalMap::even(spacing);
                if interrupt.is_raised() { start } else { map_of(&cells, positions, &order[range], start) }
            })
            .collect();
        interrupt.check()?;
        Ok(Self { order, starts, maps })
    }

    /// Whether particles near the zero of a level are stretched.
    #[must_use]
    pub fn is_stretched(&self, level: &[f64]) -> bool {
        let is_crossed = |patch: usize| {
            let particles = self.particles(patch);
            particles.iter().any(|i| level[*i] <= 0.0) && particles.iter().any(|i| level[*i] >= 0.0)
        };
        let crossed: Vec<usize> = (0..self.maps.len()).filter(|patch| is_crossed(*patch)).collect();
        let stretched = crossed.iter().filter(|patch| self.maps[**patch].stretch() >= STRETCHED).count();
        stretched > 0 && stretched as f64 >= STRETCHED_SHARE * crossed.len() as f64
    }

    /// Number of patches.
    #[must_use]
    pub fn patch_count(&self) -> usize {
        self.maps.len()
    }

    /// Indices of the particles of a patch.
    #[must_use]
    pub fn particles(&self, patch: usize) -> &[usize] {
        &self.order[self.starts[patch]..self.starts[patch + 1]]
    }

    /// The map of a patch.
    #[must_use]
    pub fn map(&self, patch: usize) -> &LocalMap<D> {
        &self.maps[patch]
    }

    /// Medians over the patches of the shortest and of the longest spacing.
    #[must_use]
    pub fn spacings(&self) -> (f64, f64) {
        let median = |length: fn(&LocalMap<D>) -> f64| {
            let mut lengths: Vec<f64> = self.maps.iter().map(length).collect();
            lengths.sort_by(f64::total_cmp);
            lengths.get(lengths.len() / 2).copied().unwrap_or(0.0)
        };
        (median(|map| map.shortest), median(|map| map.longest))
    }

    /// The largest stretch of a patch.
    #[must_use]
    pub fn largest_stretch(&self) -> f64 {
        self.maps.iter().map(LocalMap::stretch).fold(1.0, f64::max)
    }
}

/// Splits particles into patches at the medians along the longest sides of their boxes.
fn split<const D: usize>(positions: &[Vector<D>], order: &mut [usize], first: usize, starts: &mut Vec<usize>) {
    if order.len() <= PATCH {
        starts.push(first + order.len());
        return;
    }
    let (low, high) = bounding_box(positions, order);
    let axis = (high - low).imax();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |a, b| positions[*a][axis].total_cmp(&positions[*b][axis]).then(a.cmp(b)));
    let (lower, upper) = order.split_at_mut(middle);
    split(positions, lower, first, starts);
    split(positions, upper, first + middle, starts);
}

fn bounding_box<const D: usize>(positions: &[Vector<D>], order: &[usize]) -> (Vector<D>, Vector<D>) {
    let (low, high) = (Vector::<D>::repeat(f64::INFINITY), Vector::<D>::repeat(f64::NEG_INFINITY));
    order.iter().fold((low, high), |(low, high), i| (low.inf(&positions[*i]), high.sup(&positions[*i])))
}

/// The spacing of particles that fill their bounding box.
fn mean_spacing<const D: usize>(positions: &[Vector<D>], order: &[usize]) -> f64 {
    let (low, high) = bounding_box(positions, order);
    let sides = high - low;
    let volume: f64 = sides.iter().product();
    let mean = (volume / order.len().max(1) as f64).powf(1.0 / D as f64);
    if mean > 0.0 && mean.is_finite() { mean } else { sides.max().max(f64::MIN_POSITIVE) / order.len().max(1) as f64 }
}

/// What the neighborhoods of some particles show.
struct Look<const D: usize> {
    /// Mean number of particles in a neighborhood.
    count: f64,
    /// Second moments of the mapped offsets to adjacent particles.
    moments: SMatrix<f64, D, D>,
}

/// The map of a patch.
///
/// 1. Change the spacing until neighborhoods have the wanted number of particles.
/// 2. Look at a few particles. If they lie about as densely in every direction, the map is even.
/// 3. Improve the map with the moments of all particles of the patch.
fn map_of<const D: usize>(
    cells: &CellList<D>,
    positions: &[Vector<D>],
    particles: &[usize],
    start: LocalMap<D>,
) -> LocalMap<D> {
    let wanted = looked_at(D);
    let few: Vec<usize> = particles.iter().copied().step_by(particles.len().div_ceil(FIRST_LOOK).max(1)).collect();
    let mut map = start;
    let mut is_first = true;
    let mut neighbors = Vec::new();
    for _ in 0..ROUNDS {
        let seen = look(cells, positions, if is_first { &few } else { particles }, &map, &mut neighbors);
        let factor = (wanted / seen.count).powf(1.0 / D as f64);
        if !(0.85..=1.2).contains(&factor) {
            map = map.coarser(factor.clamp(0.25, 2.0));
            continue;
        }
        let (least, most) = range_of_eigenvalues(&seen.moments);
        let left = (most / least.max(0.0)).sqrt();
        if left < if is_first { EVEN } else { SETTLED } {
            break;
        }
        is_first = false;
        // Eigenvalues far below the largest stand for directions in which no neighbor was seen yet.
        let floor = most / (MOST_CHANGE * MOST_CHANGE);
        let change = spectral(&seen.moments, |value| 1.0 / value.max(floor));
        let scale = determinant(&change).powf(1.0 / D as f64);
        let metric = map.map * change * map.map / scale;
        match LocalMap::from_metric(&metric).filter(|next| next.stretch() <= MOST_STRETCH) {
            Some(next) => map = next,
            None => break,
        }
    }
    map
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
    let mut moments = SMatrix::<f64, D, D>::zeros();
    let (mut count, mut pairs) = (0, 0);
    for i in particles {
        search.gather(&(map.map * positions[*i]), radius, neighbors);
        count += neighbors.len();
        neighbors.retain(|neighbor| neighbor.index != *i && neighbor.r2 > 0.0);
        // The nearest neighbors rule out most pairs.
        neighbors.sort_unstable_by(|a, b| a.r2.total_cmp(&b.r2).then(a.index.cmp(&b.index)));
        for j in &*neighbors {
            // A lattice has particles on the spheres themselves. They do not count as inside, whatever the rounding.
            let is_inside = |k: &Neighbor<D>| k.r2 - k.dx.dot(&j.dx) < -1e-9 * j.r2;
            if !neighbors.iter().take_while(|k| k.r2 < j.r2).any(is_inside) {
                moments += j.dx * j.dx.transpose();
                pairs += 1;
            }
        }
    }
    Look { count: count as f64 / particles.len().max(1) as f64, moments: moments / f64::from(pairs.max(1)) }
}
