//! The metric of a stretched cloud: a linear map for each patch of some dozens of particles.

use super::local_map::LocalMap;
use super::map_search::{bounding_box, map_of, mean_spacing};
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, KdTree};
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

/// Patches of a cloud, and the map of each patch next to the surface.
#[derive(Debug, Clone)]
pub struct CloudMetric<const D: usize> {
    /// Indices of the particles, patch by patch.
    order: Vec<usize>,
    /// First slot of each patch in `order`, and the number of particles at the end.
    starts: Vec<usize>,
    /// Patch of each particle.
    patch_of: Vec<usize>,
    maps: Vec<LocalMap<D>>,
    /// Patches through which the surface passes; all where it passes through none.
    crossed: Vec<usize>,
    /// Whether each patch is crossed or lies next to such patches.
    is_next_to_surface: Vec<bool>,
}

/// Largest number of particles of a patch.
const PATCH: usize = 64;
/// Factor by which the stretch beside a patch must be larger for its map to be tried.
const MUCH_MORE: f64 = 2.0;
/// How often maps pass from patch to patch.
const PASSES: usize = 4;

/// Number of patches around one that count as next to it.
const fn patches_around(dimension: usize) -> usize {
    if dimension == 2 { 20 } else { 60 }
}

impl<const D: usize> CloudMetric<D> {
    /// The metric of a cloud in the patches through which the zero of its level passes.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn new(positions: &[Vector<D>], level: &[f64], interrupt: &Interrupt) -> Result<Self, Interrupted> {
        let mut order: Vec<usize> = (0..positions.len()).collect();
        let mut starts = vec![0];
        split(positions, &mut order, 0, &mut starts);
        let mut patch_of = vec![0; positions.len()];
        for (patch, range) in starts.windows(2).enumerate() {
            order[range[0]..range[1]].iter().for_each(|i| patch_of[*i] = patch);
        }
        let count = starts.len() - 1;
        let is_crossed = |patch: &usize| is_crossed(&order[starts[*patch]..starts[patch + 1]], level);
        let mut crossed: Vec<usize> = (0..count).filter(is_crossed).collect();
        if crossed.is_empty() {
            crossed.extend(0..count);
        }
        let even = LocalMap::even(mean_spacing(positions, &order));
        let (maps, is_next_to_surface) = (vec![even; count], vec![false; count]);
        let mut metric = Self { order, starts, patch_of, maps, crossed, is_next_to_surface };
        let all = metric.crossed.iter().map(|patch| (*patch, even, true)).collect();
        let found = metric.maps_from(&metric.sorted(positions), positions, all, interrupt);
        found.into_iter().for_each(|(patch, (map, _))| metric.maps[patch] = map);
        interrupt.check()?;
        Ok(metric)
    }

    /// The metric with the maps of all patches next to the surface.
    ///
    /// 1. Crossed patches try the maps of more stretched ones beside them. Jittered particles may lie as evenly under
    ///    two maps, and patches side by side should have the same.
    /// 2. The other patches next to the surface begin with the map of the nearest crossed patch.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn completed(mut self, positions: &[Vector<D>], interrupt: &Interrupt) -> Result<Self, Interrupted> {
        let cells = self.sorted(positions);
        let center = |patch: &usize| {
            let particles = self.particles(*patch);
            particles.iter().map(|i| positions[*i]).sum::<Vector<D>>() / particles.len().max(1) as f64
        };
        let centers: Vec<Vector<D>> = (0..self.maps.len()).collect::<Vec<_>>().iter().map(center).collect();
        let crossed: Vec<Vector<D>> = self.crossed.iter().map(|patch| centers[*patch]).collect();
        let (all_patches, crossed_patches) = (KdTree::new(&centers), KdTree::new(&crossed));
        let mut found = Vec::new();
        for _ in 0..PASSES {
            let mut tries = Vec::new();
            for patch in &self.crossed {
                crossed_patches.nearest(&centers[*patch], 2 * D + 1, &mut found);
                let beside = found.iter().map(|(_, k)| self.maps[self.crossed[*k as usize]]);
                let most = beside.max_by(|a, b| a.stretch().total_cmp(&b.stretch()));
                let own = self.maps[*patch].stretch();
                tries.extend(most.filter(|map| map.stretch() > MUCH_MORE * own).map(|map| (*patch, map, false)));
            }
            if tries.is_empty() {
                break;
            }
            for (patch, (map, is_settled)) in self.maps_from(&cells, positions, tries, interrupt) {
                if is_settled {
                    self.maps[patch] = map;
                }
            }
        }
        self.crossed.iter().for_each(|patch| self.is_next_to_surface[*patch] = true);
        let mut others = Vec::new();
        for patch in &self.crossed {
            all_patches.nearest(&centers[*patch], patches_around(D), &mut found);
            for (_, other) in &found {
                let other = *other as usize;
                if !std::mem::replace(&mut self.is_next_to_surface[other], true) {
                    others.push(other);
                }
            }
        }
        let start = |patch: usize| {
            crossed_patches.nearest(&centers[patch], 1, &mut found);
            let nearest = found.first().map_or(patch, |(_, k)| self.crossed[*k as usize]);
            (patch, self.maps[nearest], false)
        };
        let tries = others.into_iter().map(start).collect();
        for (patch, (map, _)) in self.maps_from(&cells, positions, tries, interrupt) {
            self.maps[patch] = map;
        }
        interrupt.check()?;
        Ok(self)
    }

    /// The particles sorted for searches.
    fn sorted(&self, positions: &[Vector<D>]) -> CellList<D> {
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(positions.iter().copied(), 2.0 * mean_spacing(positions, &self.order));
        cells
    }

    /// The maps of patches, each with the map to begin with and whether a first look may end the search.
    fn maps_from(
        &self,
        cells: &CellList<D>,
        positions: &[Vector<D>],
        tries: Vec<(usize, LocalMap<D>, bool)>,
        interrupt: &Interrupt,
    ) -> Vec<(usize, (LocalMap<D>, bool))> {
        tries
            .into_par_iter()
            .with_max_len(1)
            .map(|(patch, start, is_first)| {
                let is_dropped = interrupt.is_raised();
                let find = || map_of(cells, positions, self.particles(patch), start, is_first);
                (patch, if is_dropped { (start, false) } else { find() })
            })
            .collect()
    }

    /// Whether a patch is crossed by the surface or lies next to such patches.
    #[must_use]
    pub fn is_next_to_surface(&self, patch: usize) -> bool {
        self.is_next_to_surface[patch]
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

    /// The patch of a particle.
    #[must_use]
    pub fn patch_of(&self, particle: usize) -> usize {
        self.patch_of[particle]
    }

    /// The map of a patch.
    #[must_use]
    pub fn map(&self, patch: usize) -> &LocalMap<D> {
        &self.maps[patch]
    }

    /// Medians of the shortest and of the longest spacing near the surface.
    #[must_use]
    pub fn spacings(&self) -> (f64, f64) {
        (self.median(|map| map.shortest), self.median(|map| map.longest))
    }

    fn median(&self, length: impl Fn(&LocalMap<D>) -> f64) -> f64 {
        let mut lengths: Vec<f64> = self.crossed.iter().map(|patch| length(&self.maps[*patch])).collect();
        lengths.sort_by(f64::total_cmp);
        lengths.get(lengths.len() / 2).copied().unwrap_or(0.0)
    }
}

/// Whether the surface passes through a patch.
fn is_crossed(particles: &[usize], level: &[f64]) -> bool {
    particles.iter().any(|i| level[*i] <= 0.0) && particles.iter().any(|i| level[*i] >= 0.0)
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

#[cfg(test)]
mod tests {
    use super::{CellList, CloudMetric, Domain, Interrupt, Vector};
    use crate::closest_point::Stretch;
    use crate::geometry::random::CounterRandom;

    /// A lattice in the unit square or cube, stretched by the given spacings along turned axes, and moved by up to
    /// `jitter` spacings along each of them.
    fn lattice<const D: usize>(spacings: Vector<D>, angle: f64, jitter: f64) -> Vec<Vector<D>> {
        let random = CounterRandom::new(5);
        let counts: [i64; D] = std::array::from_fn(|d| (1.3 / spacings[d]).ceil() as i64);
        let total: i64 = counts.iter().map(|n| 2 * n + 1).product();
        let (sin, cos) = angle.sin_cos();
        let place = |k: i64| {
            let mut rest = k;
            let mut x = Vector::<D>::from_fn(|d, _| {
                let index = rest % (2 * counts[d] + 1) - counts[d];
                rest /= 2 * counts[d] + 1;
                spacings[d] * (index as f64 + jitter * random.symmetric(&[k, d as i64]))
            });
            (x[0], x[1]) = (cos * x[0] - sin * x[1], sin * x[0] + cos * x[1]);
            x
        };
        (0..total).map(place).filter(|x| x.amax() <= 1.0).collect()
    }

    /// Share of the crossed patches whose stretch lies within a factor of 1.5 of the expected one, and whether
    /// the cloud is stretched. Small moves take pairs across corners out of the graph at random, which favors the stretch.
    fn share<const D: usize>(spacings: Vector<D>, angle: f64, jitter: f64) -> (f64, bool) {
        let points = lattice(spacings, angle, jitter);
        let level: Vec<f64> = points.iter().map(|x| x.norm() - 0.6).collect();
        let never = Interrupt::default();
        let metric = CloudMetric::new(&points, &level, &never).unwrap();
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), spacings.max());
        let is_stretched = Stretch::new(&cells, &points, &level).is_large();
        let metric = metric.completed(&points, &never).unwrap();
        let expected = spacings.max() / spacings.min();
        let is_right = |patch: &&usize| {
            let ratio = metric.map(**patch).stretch() / expected;
            (1.0 / 1.5..=1.5).contains(&ratio)
        };
        (metric.crossed.iter().filter(is_right).count() as f64 / metric.crossed.len() as f64, is_stretched)
    }

    #[test]
    fn the_stretch_of_a_turned_lattice_is_found() {
        for ratio in [2.0, 4.0, 10.0] {
            for angle in [0.0, 0.5, 0.785] {
                for jitter in [0.0, 0.1, 0.3] {
                    let found = share(Vector::<2>::new(1.0 / 16.0, 1.0 / 16.0 / ratio), angle, jitter);
                    // Where particles move by a third of a spacing, some patches lie as evenly under another map.
                    let least = if jitter < 0.2 { 0.95 } else { 0.6 };
                    assert!(found.0 >= least && found.1, "{ratio} {angle} {jitter}: {found:?}");
                }
            }
        }
        for spacings in [Vector::<3>::new(1.0, 1.0, 0.2), Vector::<3>::new(1.0, 0.2, 0.2)] {
            let found = share(spacings * 0.2, 0.4, 0.1);
            // Measured: 0.65 and more; patches of so few spacings tell no more in space.
            assert!(found.0 >= 0.6 && found.1, "{spacings:?}: {found:?}");
        }
    }

    #[test]
    fn even_lattices_are_not_stretched() {
        for jitter in [0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.49] {
            for angle in [0.0, 0.3, 0.785] {
                assert!(!share(Vector::<2>::repeat(1.0 / 20.0), angle, jitter).1, "{jitter} {angle}");
                assert!(!share(Vector::<3>::repeat(0.2), angle, jitter).1, "3D {jitter} {angle}");
            }
        }
    }
}
