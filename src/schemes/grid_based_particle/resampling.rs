//! New foot points for all grid points near the front, after a motion (GBPM 3.3 and 3.4).
//!
//! Particles are found by their positions, not by their old grid points. So a step may be as long as the flow allows, and
//! activation and deactivation of the tube are one operation.

use super::config::FrontConfig;
use super::foot_points::FootPoints;
use super::gaps::{GapSearch, REACH_ALONG};
use super::grid::{Grid, Node};
use super::reconstruction::{Failure, Outcome};
use super::reconstructor::Reconstructor;
use super::refinement::{Hints, Refinement, Window};
use super::removals::Removals;
use crate::geometry::Domain;
use crate::neighbors::CellList;
use crate::parallel::{BLOCK, Interrupted, one_by_one};
use rayon::prelude::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator, ParallelSliceMut};

/// Tuning constants of resampling. Lengths are in spacings.
struct ResamplingTuning {
    /// Half width of the window in which a particle proposes grid points across the front, beyond γ: for the bend of the
    /// front.
    margin_across: f64,
    /// Distance of a moved particle from a new foot point of its segment within which it is replaced, on a curve and on a
    /// surface: half the largest distance between neighbors. With less, particles would stay that nothing misses, and they
    /// distort reconstructions.
    replaced: [f64; 2],
    /// The same at a gap and at the end of a segment, where a particle that is lost is never found again. Of .15 and .02, the
    /// first left gaps of up to 17 h (docs/results/front-notes.md, The vortex at T = 8).
    replaced_at_gap: f64,
}

const TUNING: ResamplingTuning = ResamplingTuning { margin_across: 0.35, replaced: [0.55, 1.0], replaced_at_gap: 0.02 };
/// Particles whose proposals are sorted together.
const PROPOSING: usize = 256;

/// Grid points that a block of particles proposes.
#[derive(Debug, Default)]
struct Proposals {
    nodes: Vec<Node>,
    hints: Hints,
    /// Particles beyond the end of the grid.
    outside: u64,
}

/// Storage of resampling, which lasts from step to step.
pub(super) struct Resampling<const D: usize> {
    proposals: Vec<Proposals>,
    /// All proposed grid points, each once and in order, and their foot points.
    candidates: Vec<Node>,
    outcomes: Vec<Outcome<D>>,
    /// Whether each moved particle is next to a gap or at the end of its segment.
    at_gap: Vec<bool>,
    /// Whether each moved particle stays.
    keep: Vec<bool>,
    /// The new foot points, and the same sorted into cells.
    fresh: FootPoints<D>,
    fresh_cells: CellList<D>,
}

/// The moved particles, and what resampling reads beside them.
struct Moved<'a, const D: usize, const M: usize> {
    feet: &'a FootPoints<D>,
    config: &'a FrontConfig<D, M>,
    refinement: &'a Refinement,
    at_gap: &'a [bool],
}

impl<const D: usize> Default for Resampling<D> {
    fn default() -> Self {
        Self {
            proposals: Vec::new(),
            candidates: Vec::new(),
            outcomes: Vec::new(),
            at_gap: Vec::new(),
            keep: Vec::new(),
            fresh: FootPoints::default(),
            fresh_cells: CellList::new(Domain::unbounded()),
        }
    }
}

impl<const D: usize> Resampling<D> {
    /// Replaces the moved particles by the foot points of the grid points near them. The reconstructor has the particles
    /// sorted, and the grid is refined for them.
    ///
    /// 1. Mark the particles at gaps.
    /// 2. Each particle proposes the grid points about it.
    /// 3. Each of these gets the closest point of its local reconstruction.
    /// 4. Those within the tube are the new foot points.
    /// 5. Where every particle is exact by itself, as in a flow, the particles that nothing has replaced stay.
    ///
    /// # Errors
    /// [`Interrupted`] when the run is asked to stop.
    pub fn resample<const M: usize>(
        &mut self,
        feet: &mut FootPoints<D>,
        config: &FrontConfig<D, M>,
        reconstructor: &Reconstructor<D, M>,
        refinement: &Refinement,
        removals: &mut Removals,
    ) -> Result<(), Interrupted> {
        self.at_gap.clear();
        self.at_gap.resize(feet.len(), false);
        let keeps_particles = config.law.keeps_particles_exact();
        if keeps_particles {
            // Elsewhere a gap is closed by reconstructions, or another segment has swept it.
            GapSearch { feet, cells: reconstructor.cells(), config }.mark(&mut self.at_gap)?;
        }
        config.interrupt.check()?;
        let at_gap = std::mem::take(&mut self.at_gap);
        let moved = Moved { feet, config, refinement, at_gap: &at_gap };
        removals.outside += self.propose(&moved);
        let place = |_: usize, node: &Node| (config.grid.place(*node), config.grid.spacing_of(*node));
        let reconstruction = reconstructor.reconstruction(feet, config);
        let found = reconstructor.closest_points(&reconstruction, &self.candidates, &mut self.outcomes, place);
        if found.is_ok() {
            self.renew(config, removals);
            if keeps_particles {
                self.keep_unreplaced(&moved, removals);
            }
        }
        self.at_gap = at_gap;
        found?;
        std::mem::swap(feet, &mut self.fresh);
        Ok(())
    }

    /// Collects the grid points that the particles propose, each once and in order. Returns the number of particles beyond the
    /// end of the grid.
    fn propose<const M: usize>(&mut self, moved: &Moved<'_, D, M>) -> u64 {
        let Self { proposals, candidates, .. } = self;
        let count = moved.feet.len();
        proposals.resize_with(count.div_ceil(PROPOSING).max(proposals.len()), Proposals::default);
        one_by_one(proposals.par_iter_mut().enumerate()).for_each(|(block, proposals)| {
            proposals.nodes.clear();
            proposals.outside = 0;
            for i in block * PROPOSING..((block + 1) * PROPOSING).min(count) {
                moved.propose_about(i, proposals);
            }
            proposals.nodes.sort_unstable();
            proposals.nodes.dedup();
        });
        candidates.clear();
        for proposals in &*proposals {
            candidates.extend_from_slice(&proposals.nodes);
        }
        candidates.par_sort_unstable();
        candidates.dedup();
        proposals.iter().map(|proposals| proposals.outside).sum()
    }

    /// Takes the closest points within the tube as the new foot points, and counts the others by reason.
    fn renew<const M: usize>(&mut self, config: &FrontConfig<D, M>, removals: &mut Removals) {
        let (grid, radius) = (&config.grid, config.method.tube_radius);
        self.fresh.clear();
        for (node, outcome) in self.candidates.iter().zip(&self.outcomes) {
            match outcome {
                Ok(foot) => {
                    if (foot.position - grid.place::<D>(*node)).norm() <= radius * grid.spacing_of(*node) {
                        self.fresh.push(*node, foot);
                    }
                }
                Err(Failure::Starved | Failure::Undetermined) => removals.starved += 1,
                Err(Failure::Extrapolated) => removals.extrapolated += 1,
                Err(Failure::Unresolved) => removals.unresolved += 1,
                Err(Failure::Swept) => removals.swept += 1,
            }
        }
    }

    /// Adds the moved particles without a new foot point of their segment close to them.
    fn keep_unreplaced<const M: usize>(&mut self, moved: &Moved<'_, D, M>, removals: &mut Removals) {
        let Self { fresh, fresh_cells, keep, .. } = self;
        let (feet, grid) = (moved.feet, &moved.config.grid);
        fresh_cells.rebuild(fresh.positions.iter().copied(), fresh.finest_spacing(grid));
        keep.clear();
        keep.resize(feet.len(), false);
        one_by_one(keep.par_chunks_mut(BLOCK).enumerate()).for_each(|(block, keep)| {
            for (k, keep) in keep.iter_mut().enumerate() {
                *keep = !moved.is_replaced(block * BLOCK + k, fresh, fresh_cells);
            }
        });
        for i in (0..feet.len()).filter(|i| keep[*i]) {
            let foot = feet.get(i);
            if let Some(node) = moved.refinement.leaf_at(grid, &foot.position) {
                fresh.push(node, &foot);
                removals.kept += 1;
            } else {
                removals.outside += 1;
            }
        }
    }
}

impl<const D: usize, const M: usize> Moved<'_, D, M> {
    /// Adds the grid points that particle i proposes.
    fn propose_about(&self, i: usize, proposals: &mut Proposals) {
        let Proposals { nodes, hints, outside } = proposals;
        let (grid, law) = (self.config.grid, &self.config.law);
        let width = self.config.method.tube_radius + TUNING.margin_across;
        let (y, n) = (&self.feet.positions[i], &self.feet.normals[i]);
        if grid.nearest(y, self.config.method.levels() - 1).is_none() {
            // Particles that are exact by themselves are counted when they are kept.
            *outside += u64::from(!law.keeps_particles_exact());
            return;
        }
        let own = grid.spacing_of(self.feet.nodes[i]);
        let farthest = own * if self.at_gap[i] { law.widest_bridge() } else { REACH_ALONG };
        let window = |level: u32| {
            let spacing = grid.spacing_at(level);
            let (across, along) = (width * spacing, farthest.max(REACH_ALONG * spacing));
            let reach = across.hypot(along);
            let corner = |side: f64| grid.nearest(&y.add_scalar(side), level);
            let (low, high) = (corner(-reach)?, corner(reach)?);
            Some(Window { low, high, across, along, spacing, first: grid.center(&low, level) - y })
        };
        self.refinement.for_each_leaf_in(hints, window, |at, level, window| {
            let d = window.relative(at);
            // The direction is the normal of a surface and the tangent of a curve in space.
            let by_direction = d.dot(n).powi(2);
            let rest = d.norm_squared() - by_direction;
            let (across, along) = if D - M == 1 { (by_direction, rest) } else { (rest, by_direction) };
            if across <= window.across * window.across && along <= window.along * window.along {
                nodes.push(Grid::node(at, level));
            }
        });
    }

    /// Whether a new foot point of its segment is close to moved particle i.
    fn is_replaced(&self, i: usize, fresh: &FootPoints<D>, fresh_cells: &CellList<D>) -> bool {
        let grid = &self.config.grid;
        let (position, normal) = (&self.feet.positions[i], &self.feet.normals[i]);
        let Some(node) = self.refinement.leaf_at(grid, position) else { return false };
        let spacing = grid.spacing_of(node).max(grid.spacing_of(self.feet.nodes[i]));
        let replaced = if self.at_gap[i] { TUNING.replaced_at_gap } else { TUNING.replaced[M - 1] };
        let order = fresh_cells.permutation();
        fresh_cells.any_within(position, replaced * spacing, |place| {
            fresh.normals[order[place]].dot(normal) > self.config.method.cosine
        })
    }
}

#[cfg(test)]
mod tests;
