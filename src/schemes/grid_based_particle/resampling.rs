//! New foot-points for every grid point near the front, after a motion (GBPM 3.3 and 3.4).
//!
//! Particles are found by where they are, not by their old grid points: so a step may be as long as the flow allows, and activation
//! and deactivation of the tube are one thing.

use super::foot_points::FootPoint;
use super::grid::Node;
use super::reconstruction::{Failure, Reconstruction, Room, WIDEST_BRIDGE};
use super::system::FrontSystem;
use crate::geometry::Vector;
use crate::geometry::frame::tangents;
use crate::neighbors::NeighborSearch;
use crate::parallel::{BLOCK, Interrupt, Interrupted, PerThread};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};

/// Reach along the front within which a particle proposes grid points, in spacings: half the largest gap that a motion may
/// open before grid points in its middle are missed.
const ALONG: f64 = 1.4;
/// How much farther than γ across the front, in spacings: for the bend of the front.
const MARGIN: f64 = 0.35;
/// A moved particle with a new foot-point of its segment within so many spacings needs not stay: half the largest distance between
/// neighbours, on a curve and on a surface. Less would keep particles that nothing misses, which distort reconstructions.
const COVERED: [f64; 2] = [0.55, 1.0];

/// How many particles were removed, and why; and what was done to keep the front whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Removals {
    /// Grid points without enough particles of one segment about them.
    pub starved: u64,
    /// Grid points whose foot-point would lie beyond all particles.
    pub extrapolated: u64,
    /// Grid points where the front turns too sharply for the spacing.
    pub unresolved: u64,
    /// Particles that another segment has passed.
    pub swept: u64,
    /// Moved particles that stayed, since no reconstruction took their place.
    pub kept: u64,
    /// Particles beyond the end of the grid, which counts a million points from the origin.
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

/// What became of a grid point near the front.
pub(super) type Outcome<const D: usize> = Result<FootPoint<D>, Failure>;

impl<const D: usize, const M: usize> FrontSystem<D, M> {
    /// 1. The moved particles are sorted into cells. 2. Each proposes the grid points about it. 3. Each of these gets the closest
    ///    point of its local reconstruction. 4. Those within the tube are the new foot-points. 5. In a flow, where every
    ///    particle is exact by itself, one that nothing has replaced stays.
    pub(super) fn resample(&mut self) -> Result<(), Interrupted> {
        self.sort_cells();
        self.propose();
        self.outcomes.clear();
        self.outcomes.resize(self.candidates.len(), Err(Failure::Starved));
        let mut outcomes = std::mem::take(&mut self.outcomes);
        let (grid, interrupt) = (self.parts.grid, &self.parts.interrupt);
        let place = |node: &Node| grid.place(*node);
        let filled = fill(&self.reconstruction(), &self.candidates, &mut outcomes, &self.rooms, interrupt, place);
        self.outcomes = outcomes;
        filled?;
        self.renew();
        if matches!(self.parts.law, super::Law::Flow(_)) {
            self.keep_unreplaced();
        }
        std::mem::swap(&mut self.feet, &mut self.fresh);
        Ok(())
    }

    /// The grid points that the particles have about them, each once and in order.
    fn propose(&mut self) {
        let grid = self.parts.grid;
        let across = (self.parts.method.tube_radius + MARGIN) * grid.spacing;
        self.candidates.clear();
        for i in 0..self.feet.len() {
            let (y, n) = (&self.feet.positions[i], &self.feet.normals[i]);
            if grid.nearest(y).is_none() {
                self.removals.outside += 1;
                continue;
            }
            let along = if self.is_at_gap(i) { WIDEST_BRIDGE } else { ALONG };
            let reach = (self.parts.method.tube_radius + MARGIN).hypot(along).floor() as i64 + 1;
            let along = (along * grid.spacing).powi(2);
            grid.for_each_about(y, reach, |node, place| {
                let d = place - y;
                let height = d.dot(n);
                if height.abs() <= across && d.norm_squared() - height * height <= along {
                    self.candidates.push(node);
                }
            });
        }
        self.candidates.sort_unstable();
        self.candidates.dedup();
    }

    /// Whether a particle has nobody of its segment near it in some direction along the front: a motion has drawn its neighbours
    /// away, or a sharp tip has become round again and lacks particles.
    fn is_at_gap(&self, i: usize) -> bool {
        let spacing = self.parts.grid.spacing;
        let (y, n) = (&self.feet.positions[i], &self.feet.normals[i]);
        let frame = tangents::<D, M>(n);
        let mut has_neighbor = [[false; 2]; M];
        self.cells.for_each_within(y, ALONG * spacing, |j, d, square| {
            if j != i && self.feet.normals[j].dot(n) > self.parts.method.cosine {
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
        let radius = self.parts.method.tube_radius * grid.spacing;
        self.fresh.clear();
        for (node, outcome) in self.candidates.iter().zip(&self.outcomes) {
            match outcome {
                Ok(foot) => {
                    if (foot.position - grid.place::<D>(*node)).norm() <= radius {
                        self.fresh.push(*node, foot);
                    }
                }
                Err(Failure::Starved | Failure::Undetermined) => self.removals.starved += 1,
                Err(Failure::Extrapolated) => self.removals.extrapolated += 1,
                Err(Failure::Unresolved) => self.removals.unresolved += 1,
            }
        }
    }

    /// Moved particles without a new foot-point of their segment close by stay as they are.
    fn keep_unreplaced(&mut self) {
        let grid = self.parts.grid;
        self.fresh_cells.rebuild(self.fresh.positions.iter().copied(), grid.spacing);
        let order = self.fresh_cells.order();
        let reach = COVERED[M - 1] * grid.spacing;
        for i in 0..self.feet.len() {
            let foot = self.feet.get(i);
            let is_replaced = self.fresh_cells.any_within(&foot.position, reach, |place| {
                self.fresh.normals[order[place]].dot(&foot.normal) > self.parts.method.cosine
            });
            if !is_replaced && let Some(at) = grid.nearest(&foot.position) {
                let node: Node = super::Grid::node(&at);
                self.fresh.push(node, &foot);
                self.removals.kept += 1;
            }
        }
    }
}

/// The outcome of a reconstruction at every item's place.
pub(super) fn fill<const D: usize, const M: usize, T: Sync>(
    reconstruction: &Reconstruction<'_, D, M>,
    items: &[T],
    outcomes: &mut [Outcome<D>],
    rooms: &PerThread<Room<D, M>>,
    interrupt: &Interrupt,
    place: impl Fn(&T) -> Vector<D> + Sync,
) -> Result<(), Interrupted> {
    items.par_chunks(BLOCK).zip(outcomes.par_chunks_mut(BLOCK)).for_each(|(items, outcomes)| {
        if interrupt.is_raised() {
            return;
        }
        rooms.with(|room| {
            for (item, outcome) in items.iter().zip(outcomes) {
                *outcome = reconstruction.closest(&place(item), room);
            }
        });
    });
    interrupt.check()
}
