//! Particles next to a gap in their segment, or at its end.

use super::config::FrontConfig;
use super::foot_points::FootPoints;
use crate::geometry::frame::tangents;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupted, one_by_one};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSliceMut};

/// Radius within which a particle has a neighbor of its segment in each direction, in spacings. It is also the half width of
/// the window in which a particle proposes grid points along the front: half the largest gap that a motion may open before
/// grid points in its middle are missed.
pub(super) const REACH_ALONG: f64 = 1.4;
/// 1/cos² of the angle to a direction within which a neighbor counts as in that direction: 60°, so that on a surface four
/// directions cover all sides.
const CONE: f64 = 4.0;

/// The particles, sorted into cells.
pub(super) struct GapSearch<'a, const D: usize, const M: usize> {
    pub feet: &'a FootPoints<D>,
    pub cells: &'a CellList<D>,
    pub config: &'a FrontConfig<D, M>,
}

impl<const D: usize, const M: usize> GapSearch<'_, D, M> {
    /// Marks the particles next to a gap.
    ///
    /// # Errors
    /// [`Interrupted`] when the run is asked to stop.
    pub fn mark(&self, at_gap: &mut [bool]) -> Result<(), Interrupted> {
        let interrupt = &self.config.interrupt;
        one_by_one(at_gap.par_chunks_mut(BLOCK).enumerate()).for_each(|(block, at_gap)| {
            for (k, is_at_gap) in at_gap.iter_mut().enumerate() {
                if interrupt.is_raised() {
                    return;
                }
                *is_at_gap = self.is_at_gap(block * BLOCK + k);
            }
        });
        interrupt.check()
    }

    /// Whether a particle lacks a near neighbor of its segment in some direction along the front: a motion has drawn its
    /// neighbors away, or a sharp tip has become round again and lacks particles.
    pub fn is_at_gap(&self, i: usize) -> bool {
        let Self { feet, cells, config } = self;
        let spacing = config.grid.spacing_of(feet.nodes[i]);
        let (y, n) = (&feet.positions[i], &feet.normals[i]);
        let frame = if D - M == 1 { tangents::<D, M>(n) } else { [*n; M] };
        let mut has_neighbor = [[false; 2]; M];
        // On the coarser side of a border between levels the neighbors are farther away.
        let coarser = if config.method.levels() > 1 { 2.0 } else { 1.0 };
        cells.for_each_within(y, coarser * REACH_ALONG * spacing, |j, d, square| {
            let reach = REACH_ALONG * spacing.max(config.grid.spacing_of(feet.nodes[j]));
            if j != i && square <= reach * reach && feet.normals[j].dot(n) > config.method.cosine {
                for (has, t) in has_neighbor.iter_mut().zip(&frame) {
                    let ahead = t.dot(d);
                    if CONE * ahead * ahead >= square {
                        has[usize::from(ahead > 0.0)] = true;
                    }
                }
            }
        });
        !has_neighbor.iter().flatten().all(|has| *has)
    }
}

#[cfg(test)]
mod tests {
    use super::GapSearch;
    use crate::geometry::{Domain, Vector};
    use crate::neighbors::CellList;
    use crate::schemes::grid_based_particle::fixtures::{SPACING, ball, config, feet};
    use crate::schemes::grid_based_particle::laws::NormalSpeed;

    fn marks<const D: usize, const M: usize>(keeps: impl Fn(&Vector<D>) -> bool) -> Vec<(Vector<D>, bool)> {
        let config = config::<D, M>(NormalSpeed { speed: 1.0 });
        let mut feet = feet(ball::<D>(), &config);
        let keep: Vec<bool> = feet.positions.iter().map(|x| keeps(&(x - ball::<D>().center))).collect();
        feet.retain(&keep);
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(feet.positions.iter().copied(), SPACING);
        let mut at_gap = vec![false; feet.len()];
        GapSearch { feet: &feet, cells: &cells, config: &config }.mark(&mut at_gap).unwrap();
        feet.positions.iter().map(|x| x - ball::<D>().center).zip(at_gap).collect()
    }

    #[test]
    fn a_whole_front_has_no_gaps() {
        assert!(marks::<2, 1>(|_| true).iter().all(|(_, is_at_gap)| !is_at_gap));
        assert!(marks::<3, 2>(|_| true).iter().all(|(_, is_at_gap)| !is_at_gap));
    }

    #[test]
    fn the_particles_at_the_ends_of_an_arc_are_at_a_gap() {
        let found = marks::<2, 1>(|x| x[1] < 0.2);
        assert!(found.iter().any(|(_, is_at_gap)| *is_at_gap));
        for (x, is_at_gap) in found {
            // An end has the nearest particles on both sides within about a spacing of the missing arc.
            assert!(!is_at_gap || 0.2 - x[1] < SPACING, "{x}");
        }
    }

    #[test]
    fn the_rim_of_a_hole_in_a_surface_is_at_a_gap() {
        let found = marks::<3, 2>(|x| x[2] < 0.3);
        let rim = found.iter().filter(|(x, _)| x[2] > 0.3 - 0.2 * SPACING);
        assert!(rim.clone().count() > 20 && rim.clone().filter(|(_, is_at_gap)| *is_at_gap).count() > 10);
        assert!(found.iter().all(|(x, is_at_gap)| !is_at_gap || 0.3 - x[2] < 1.4 * SPACING));
    }
}
