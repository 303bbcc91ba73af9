//! New foot-points for every grid point near the front, after a motion (GBPM 3.3 and 3.4).
//!
//! Particles are found by where they are, not by their old grid points: so a step may be as long as the flow allows, and activation
//! and deactivation of the tube are one thing.

use super::foot_points::FootPoint;
use super::grid::{Grid, Node};
use super::reconstruction::{Failure, Reconstruction, Room};
use super::refinement::{Hints, Window};
use super::system::FrontSystem;
use crate::geometry::Vector;
use crate::geometry::frame::tangents;
use crate::neighbors::NeighborSearch;
use crate::parallel::{BLOCK, Interrupt, Interrupted, PerThread, one_by_one};
use rayon::prelude::{
    IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator, ParallelSlice, ParallelSliceMut,
};

/// Reach along the front within which a particle proposes grid points, in spacings: half the largest gap that a motion may
/// open before grid points in its middle are missed.
const ALONG: f64 = 1.4;
/// How much farther than γ across the front, in spacings: for the bend of the front.
const MARGIN: f64 = 0.35;
/// Particles whose proposals are put in order together.
const PROPOSING: usize = 256;
/// A moved particle with a new foot-point of its segment within so many spacings needs not stay: half the largest distance between
/// neighbours, on a curve and on a surface. Less would keep particles that nothing misses, which distort reconstructions.
const COVERED: [f64; 2] = [0.55, 1.0];
/// The same at the end of a segment, a corner or the tip of a filament, and at a gap: whatever is lost there is never found again.
const SAME: f64 = 0.02;

/// How many particles were removed, and why; and what was done to keep the front whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Removals {
    /// Grid points without enough particles of one segment about them.
    pub starved: u64,
    /// Grid points whose foot-point would lie beyond all particles, or past a corner.
    pub extrapolated: u64,
    /// Grid points where the front turns too sharply for the spacing, or where a fit in a flow misses its particles' directions.
    pub unresolved: u64,
    /// Particles that another segment has passed.
    pub swept: u64,
    /// Moved particles that stayed, since no reconstruction took their place.
    pub kept: u64,
    /// Particles beyond the end of the grid, which counts half a billion cells from the origin in the plane, half a million in space.
    pub outside: u64,
}

impl Removals {
    /// Names and numbers.
    #[must_use]
    pub fn entries(&self) -> [(&'static str, u64); 6] {
        [
            ("foot_points.starved", self.starved),
            ("foot_points.extrapolated", self.extrapolated),
            ("foot_points.unresolved", self.unresolved),
            ("foot_points.swept", self.swept),
            ("particles.kept", self.kept),
            ("particles.outside", self.outside),
        ]
    }

    /// From the numbers of [`Self::entries`].
    #[must_use]
    pub fn from_numbers(n: [u64; 6]) -> Self {
        let [starved, extrapolated, unresolved, swept, kept, outside] = n;
        Self { starved, extrapolated, unresolved, swept, kept, outside }
    }
}

/// Grid points that a block of particles has about it.
#[derive(Debug, Default)]
pub(super) struct Proposals {
    nodes: Vec<Node>,
    hints: Hints,
    outside: u64,
}

/// What became of a grid point near the front.
pub(super) type Outcome<const D: usize> = Result<FootPoint<D>, Failure>;

impl<const D: usize, const M: usize> FrontSystem<D, M> {
    /// 1. The moved particles are sorted into cells, and the grid is refined where they need it. 2. Each proposes the grid points
    ///    about it. 3. Each of these gets the closest point of its local reconstruction. 4. Those within the tube are the new
    ///    foot-points. 5. Where every particle is exact by itself, in a flow, one that nothing has replaced stays.
    pub(super) fn resample(&mut self) -> Result<(), Interrupted> {
        self.sort_cells();
        self.refine()?;
        self.find_gaps()?;
        self.propose();
        self.outcomes.clear();
        self.outcomes.resize(self.candidates.len(), Err(Failure::Starved));
        let mut outcomes = std::mem::take(&mut self.outcomes);
        let (grid, interrupt) = (self.parts.grid, &self.parts.interrupt);
        let place = |_: usize, node: &Node| (grid.place(*node), grid.spacing_of(*node));
        let filled = fill(&self.reconstruction(), &self.candidates, &mut outcomes, &self.rooms, interrupt, place);
        self.outcomes = outcomes;
        filled?;
        self.renew();
        if self.parts.law.keeps_particles_exact() {
            self.keep_unreplaced();
        }
        std::mem::swap(&mut self.feet, &mut self.fresh);
        Ok(())
    }

    /// Splits the cells where the particles need it.
    pub(super) fn refine(&mut self) -> Result<(), Interrupted> {
        let Self { refinement, feet, cells, parts, .. } = self;
        refinement.renew(feet, cells, (&parts.grid, &parts.method), parts.segments, &parts.interrupt)
    }

    /// The grid points that the particles have about them, each once and in order: of each level those of cells without parts.
    fn propose(&mut self) {
        let mut proposals = std::mem::take(&mut self.proposals);
        proposals.resize_with(self.feet.len().div_ceil(PROPOSING).max(proposals.len()), Proposals::default);
        one_by_one(proposals.par_iter_mut().enumerate()).for_each(|(block, proposals)| {
            proposals.nodes.clear();
            proposals.outside = 0;
            let end = ((block + 1) * PROPOSING).min(self.feet.len());
            for i in block * PROPOSING..end {
                self.propose_about(i, proposals);
            }
            proposals.nodes.sort_unstable();
            proposals.nodes.dedup();
        });
        self.candidates.clear();
        for proposals in &proposals {
            self.candidates.extend_from_slice(&proposals.nodes);
            self.removals.outside += proposals.outside;
        }
        self.proposals = proposals;
        self.candidates.par_sort_unstable();
        self.candidates.dedup();
    }

    /// Those about one particle.
    fn propose_about(&self, i: usize, proposals: &mut Proposals) {
        let Proposals { nodes, hints, outside } = proposals;
        let grid = self.parts.grid;
        let width = self.parts.method.tube_radius + MARGIN;
        let (y, n) = (&self.feet.positions[i], &self.feet.normals[i]);
        if grid.nearest(y, self.parts.method.levels() - 1).is_none() {
            // Where particles are exact by themselves it is looked at again below.
            *outside += u64::from(!self.parts.law.keeps_particles_exact());
            return;
        }
        let own = grid.spacing_of(self.feet.nodes[i]);
        let farthest = own * if self.at_gap[i] { self.parts.law.widest_bridge() } else { ALONG };
        let window = |level: u32| {
            let spacing = grid.spacing_at(level);
            let (across, along) = (width * spacing, farthest.max(ALONG * spacing));
            let reach = across.hypot(along);
            let corner = |side: f64| grid.nearest(&y.add_scalar(side), level);
            let (low, high) = (corner(-reach)?, corner(reach)?);
            Some(Window { low, high, across, along, spacing, first: grid.center(&low, level) - y })
        };
        self.refinement.for_each_leaf_in(hints, window, |at, level, window| {
            let d = window.seen_at(at);
            // Of the squares along the direction and across it, one is that along the front.
            let by_direction = d.dot(n).powi(2);
            let rest = d.norm_squared() - by_direction;
            let (height, way) = if D - M == 1 { (by_direction, rest) } else { (rest, by_direction) };
            if height <= window.across * window.across && way <= window.along * window.along {
                nodes.push(Grid::node(at, level));
            }
        });
    }

    /// Which particles are next to a gap or at an end, in a flow.
    fn find_gaps(&mut self) -> Result<(), Interrupted> {
        let mut at_gap = std::mem::take(&mut self.at_gap);
        at_gap.clear();
        at_gap.resize(self.feet.len(), false);
        // Only a flow draws particles apart that nothing else replaces.
        let looked_at = if self.parts.law.keeps_particles_exact() { &mut at_gap[..] } else { &mut [] };
        let interrupt = &self.parts.interrupt;
        one_by_one(looked_at.par_chunks_mut(BLOCK).enumerate()).for_each(|(block, at_gap)| {
            for (k, is_at_gap) in at_gap.iter_mut().enumerate() {
                if interrupt.is_raised() {
                    return;
                }
                *is_at_gap = self.is_at_gap(block * BLOCK + k);
            }
        });
        self.at_gap = at_gap;
        self.parts.interrupt.check()
    }

    /// Whether a particle has nobody of its segment near it in some direction along the front: a motion has drawn its neighbours
    /// away, or a sharp tip has become round again and lacks particles.
    pub(super) fn is_at_gap(&self, i: usize) -> bool {
        let spacing = self.parts.grid.spacing_of(self.feet.nodes[i]);
        let (y, n) = (&self.feet.positions[i], &self.feet.normals[i]);
        let frame = if D - M == 1 { tangents::<D, M>(n) } else { [*n; M] };
        let mut has_neighbor = [[false; 2]; M];
        // The coarser side of a border between levels has its neighbours farther away.
        let coarser = if self.parts.method.levels() > 1 { 2.0 } else { 1.0 };
        self.cells.for_each_within(y, coarser * ALONG * spacing, |j, d, square| {
            let reach = ALONG * spacing.max(self.parts.grid.spacing_of(self.feet.nodes[j]));
            if j != i && square <= reach * reach && self.feet.normals[j].dot(n) > self.parts.method.cosine {
                for (has, t) in has_neighbor.iter_mut().zip(&frame) {
                    // Within 60° of the direction, so that in space somebody is on every side.
                    let ahead = t.dot(d);
                    if 4.0 * ahead * ahead >= square {
                        has[usize::from(ahead > 0.0)] = true;
                    }
                }
            }
        });
        !has_neighbor.iter().flatten().all(|has| *has)
    }

    /// New foot-points from the outcomes within the tube.
    fn renew(&mut self) {
        let grid = self.parts.grid;
        let radius = self.parts.method.tube_radius;
        self.fresh.clear();
        for (node, outcome) in self.candidates.iter().zip(&self.outcomes) {
            match outcome {
                Ok(foot) => {
                    if (foot.position - grid.place::<D>(*node)).norm() <= radius * grid.spacing_of(*node) {
                        self.fresh.push(*node, foot);
                    }
                }
                Err(Failure::Starved | Failure::Undetermined) => self.removals.starved += 1,
                Err(Failure::Extrapolated) => self.removals.extrapolated += 1,
                Err(Failure::Unresolved) => self.removals.unresolved += 1,
                Err(Failure::Swept) => self.removals.swept += 1,
            }
        }
    }

    /// Moved particles without a new foot-point of their segment close by stay as they are.
    fn keep_unreplaced(&mut self) {
        let edge = self.fresh.finest_spacing(&self.parts.grid);
        self.fresh_cells.rebuild(self.fresh.positions.iter().copied(), edge);
        let mut keep = std::mem::take(&mut self.keep);
        keep.clear();
        keep.resize(self.feet.len(), false);
        one_by_one(keep.par_chunks_mut(BLOCK).enumerate()).for_each(|(block, keep)| {
            for (k, keep) in keep.iter_mut().enumerate() {
                *keep = !self.is_replaced(block * BLOCK + k);
            }
        });
        for i in (0..self.feet.len()).filter(|i| keep[*i]) {
            let foot = self.feet.get(i);
            if let Some(node) = self.refinement.leaf_at(&self.parts.grid, &foot.position) {
                self.fresh.push(node, &foot);
                self.removals.kept += 1;
            } else {
                self.removals.outside += 1;
            }
        }
        self.keep = keep;
    }

    /// Whether a new foot-point of its segment is close to a moved particle.
    fn is_replaced(&self, i: usize) -> bool {
        let grid = &self.parts.grid;
        let (position, normal) = (&self.feet.positions[i], &self.feet.normals[i]);
        let Some(node) = self.refinement.leaf_at(grid, position) else { return false };
        let spacing = grid.spacing_of(node).max(grid.spacing_of(self.feet.nodes[i]));
        let covered = if self.at_gap[i] { SAME } else { COVERED[M - 1] };
        let order = self.fresh_cells.permutation();
        self.fresh_cells.any_within(position, covered * spacing, |place| {
            self.fresh.normals[order[place]].dot(normal) > self.parts.method.cosine
        })
    }
}

/// The outcome of a reconstruction at every item's place, where the grid has that spacing.
pub(super) fn fill<const D: usize, const M: usize, T: Sync>(
    reconstruction: &Reconstruction<'_, D, M>,
    items: &[T],
    outcomes: &mut [Outcome<D>],
    rooms: &PerThread<Room<D, M>>,
    interrupt: &Interrupt,
    place: impl Fn(usize, &T) -> (Vector<D>, f64) + Sync,
) -> Result<(), Interrupted> {
    let blocks = items.par_chunks(BLOCK).zip(outcomes.par_chunks_mut(BLOCK)).enumerate();
    one_by_one(blocks).for_each(|(block, (items, outcomes))| {
        if interrupt.is_raised() {
            return;
        }
        rooms.with(|room| {
            for (k, (item, outcome)) in items.iter().zip(outcomes).enumerate() {
                let (place, spacing) = place(block * BLOCK + k, item);
                *outcome = reconstruction.closest(&place, spacing, room);
            }
        });
    });
    interrupt.check()
}
