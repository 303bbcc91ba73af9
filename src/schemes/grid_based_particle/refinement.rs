//! Where the grid is refined, and where it becomes coarse again (GBPM 3.5): by the curvature relative to the local spacing, and
//! where another segment is close (GBPM 3.6, remark 1).
//!
//! Only the levels of the foot points last from step to step: each step finds anew the level that each particle needs, which
//! may be one level coarser than its own. Both refinement and coarsening follow from that.

use super::config::FrontConfig;
use super::foot_points::FootPoints;
use super::grid::{Grid, MOST_LEVELS, Node};
use super::method::Adaptivity;
use crate::geometry::Vector;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupted, one_by_one};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSliceMut};

/// Tuning constants of refinement. Lengths are in spacings of the level of a particle.
struct RefinementTuning {
    /// Range of distances between particles in which a turn of their normals counts as curvature: a corner is one. At shorter
    /// distances, rounding and the errors of fits turn normals as much as the front does.
    turn_range: [f64; 2],
    /// Least distance to another segment.
    clearance: f64,
    /// A level is given up where the coarser one fulfills the criterion with this share of its c, so that levels do not
    /// alternate.
    coarsening_share: f64,
}

const TUNING: RefinementTuning = RefinementTuning { turn_range: [0.25, 1.5], clearance: 2.0, coarsening_share: 0.7 };
/// Rings of cells about the cell of a particle that are split with it, so that no support of a coarse cell reaches to where
/// the front turns faster. With half a ring the vortex without reversal was torn from t = 1 on, with one and a half it held to
/// t = 2.4 (docs/results/front-notes.md, Refinement).
const RINGS: Node = 3;
/// Shifts whose sums, each taken at most once, are all numbers up to 2 · [`RINGS`].
const SHIFTS: [Node; 3] = [1, 2, 3];

/// The cells of one level about a particle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window<const D: usize> {
    /// Coordinates of the first and the last cell.
    pub low: [i64; D],
    pub high: [i64; D],
    /// Largest distances from the particle to a grid point across the front and along it.
    pub across: f64,
    pub along: f64,
    /// h of the level.
    pub spacing: f64,
    /// The grid point of the first cell, relative to the particle.
    pub first: Vector<D>,
}

impl<const D: usize> Window<D> {
    /// A grid point relative to the particle.
    pub fn relative(&self, at: &[i64; D]) -> Vector<D> {
        Vector::<D>::from_fn(|d, _| self.first[d] + (at[d] - self.low[d]) as f64 * self.spacing)
    }
}

/// Index of the last row found in each level; the next row is close to it.
pub(super) type Hints = [usize; MOST_LEVELS as usize];

/// The split cells of all levels.
#[derive(Debug, Default)]
pub(super) struct Refinement {
    /// The split cells in ascending order.
    split: Vec<Node>,
    /// The level that each particle needs.
    needs: Vec<u32>,
    /// Cells of one level with particles that need finer cells, and the rings about them.
    occupied: Vec<Node>,
    /// Storage for unions of cells.
    united: Vec<Node>,
}

impl Refinement {
    /// Finds the split cells anew from particles sorted into cells.
    ///
    /// # Errors
    /// [`Interrupted`] when the run is asked to stop.
    pub fn renew<const D: usize, const M: usize>(
        &mut self,
        feet: &FootPoints<D>,
        cells: &CellList<D>,
        config: &FrontConfig<D, M>,
    ) -> Result<(), Interrupted> {
        self.split.clear();
        let Some(adaptivity) = config.method.adaptivity else { return Ok(()) };
        let (grid, interrupt) = (&config.grid, &config.interrupt);
        let search = LevelSearch { feet, cells, config, adaptivity };
        self.needs.clear();
        self.needs.resize(feet.len(), 0);
        one_by_one(self.needs.par_chunks_mut(BLOCK).enumerate()).for_each(|(block, needs)| {
            for (k, need) in needs.iter_mut().enumerate() {
                if interrupt.is_raised() {
                    return;
                }
                *need = search.needed_level(block * BLOCK + k);
            }
        });
        interrupt.check()?;
        // Level by level: the cells with particles that need finer ones, each once, and the rings about them.
        for level in 0..adaptivity.levels - 1 {
            interrupt.check()?;
            self.occupied.clear();
            for (x, need) in feet.positions.iter().zip(&self.needs) {
                if *need > level
                    && let Some(at) = grid.nearest(x, level)
                {
                    self.occupied.push(Grid::node(&at, level));
                }
            }
            self.occupied.par_sort_unstable();
            self.occupied.dedup();
            self.add_rings::<D>();
            self.split.extend_from_slice(&self.occupied);
        }
        Ok(())
    }

    /// Adds the rings about the occupied cells of a level and keeps them in order: beginning with the lowest corners, the cells
    /// are united along each axis with their shifted copies.
    fn add_rings<const D: usize>(&mut self) {
        let corner: Node = (0..D).map(|d| RINGS * Grid::next_along::<D>(d)).sum();
        self.occupied.iter_mut().for_each(|node| *node -= corner);
        for d in 0..D {
            for shift in SHIFTS {
                unite(&self.occupied, shift * Grid::next_along::<D>(d), &mut self.united);
                std::mem::swap(&mut self.occupied, &mut self.united);
            }
        }
    }

    /// Whether any cell of a level is split.
    pub fn splits_level(&self, level: u32) -> bool {
        let place = self.split.partition_point(|node| Grid::level(*node) < level);
        self.split.get(place).is_some_and(|node| Grid::level(*node) == level)
    }

    /// The number of split cells.
    pub fn count(&self) -> usize {
        self.split.len()
    }

    /// Whether a cell is split.
    pub fn is_split(&self, node: Node) -> bool {
        !self.split.is_empty() && self.split.binary_search(&node).is_ok()
    }

    /// Calls `visit` for the cells of all levels that are not split, within the window of their level. Beyond the end of the
    /// grid there is no window.
    pub fn for_each_leaf_in<const D: usize>(
        &self,
        hints: &mut Hints,
        window: impl Fn(u32) -> Option<Window<D>>,
        visit: impl FnMut(&[i64; D], u32, &Window<D>),
    ) {
        let Some(first) = window(0) else { return };
        let (low, high) = (first.low, first.high);
        Descent { refinement: self, hints, window, visit }.visit_box(&first, &low, &high, 0);
    }

    /// Index of the first split cell that is not before a node. The search starts near a known index, with strides that double
    /// and then halve.
    fn first_from(&self, near: usize, node: Node) -> usize {
        let split = &self.split;
        let (mut low, mut high, mut stride) = (near.min(split.len()), near.min(split.len()), 1);
        if split.get(low).is_some_and(|at| *at < node) {
            while split.get(high).is_some_and(|at| *at < node) {
                (low, high, stride) = (high + 1, high + stride, 2 * stride);
            }
        } else {
            while low > 0 && split[low - 1] >= node {
                (high, low, stride) = (low - 1, low.saturating_sub(stride), 2 * stride);
            }
        }
        let (low, high) = (low.min(split.len()), high.min(split.len()));
        low + split[low..high].partition_point(|at| *at < node)
    }

    /// Whether a cell exists and is not split.
    pub fn is_leaf<const D: usize>(&self, at: &[i64; D], level: u32) -> bool {
        let is_there = level == 0 || self.is_split(Grid::node(&at.map(|c| c >> 1), level - 1));
        is_there && !self.is_split(Grid::node(at, level))
    }

    /// The grid point of the unsplit cell that contains a place; None beyond the end of the grid.
    pub fn leaf_at<const D: usize>(&self, grid: &Grid, x: &Vector<D>) -> Option<Node> {
        let mut level = 0;
        loop {
            let node = Grid::node(&grid.nearest(x, level)?, level);
            if !self.is_split(node) {
                return Some(node);
            }
            level += 1;
        }
    }
}

/// A walk over the unsplit cells of all levels.
struct Descent<'a, W, V> {
    refinement: &'a Refinement,
    hints: &'a mut Hints,
    window: W,
    visit: V,
}

impl<W, V> Descent<'_, W, V> {
    /// Visits the unsplit cells of a box of one level, and of finer levels in its split cells.
    fn visit_box<const D: usize>(&mut self, here: &Window<D>, low: &[i64; D], high: &[i64; D], level: u32)
    where
        W: Fn(u32) -> Option<Window<D>>,
        V: FnMut(&[i64; D], u32, &Window<D>),
    {
        let refinement = self.refinement;
        let mut finer = None;
        // Index of the first split cell that is not before the present one: cells of a row follow each other, so one search a
        // row is enough.
        let mut next = 0;
        Grid::for_each_in(low, high, |at| {
            let node = Grid::node(at, level);
            if at[0] == low[0] {
                next = refinement.first_from(self.hints[level as usize], node);
                self.hints[level as usize] = next;
            }
            let is_split = refinement.split.get(next) == Some(&node);
            next += usize::from(is_split);
            if !is_split {
                (self.visit)(at, level, here);
            } else if let Some(below) = finer.get_or_insert_with(|| (self.window)(level + 1)) {
                let low = std::array::from_fn(|d| (2 * at[d]).max(below.low[d]));
                let high = std::array::from_fn(|d| (2 * at[d] + 1).min(below.high[d]));
                self.visit_box(below, &low, &high, level + 1);
            }
        });
    }
}

/// The union of ascending numbers and the same numbers increased by a shift, in ascending order.
fn unite(nodes: &[Node], shift: Node, out: &mut Vec<Node>) {
    out.clear();
    let mut next = 0;
    for shifted in nodes.iter().map(|node| node + shift) {
        while next < nodes.len() && nodes[next] < shifted {
            out.push(nodes[next]);
            next += 1;
        }
        next += usize::from(nodes.get(next) == Some(&shifted));
        out.push(shifted);
    }
}

/// What the level of a particle depends on.
struct LevelSearch<'a, const D: usize, const M: usize> {
    feet: &'a FootPoints<D>,
    cells: &'a CellList<D>,
    config: &'a FrontConfig<D, M>,
    adaptivity: Adaptivity,
}

impl<const D: usize, const M: usize> LevelSearch<'_, D, M> {
    /// The coarsest level that is fine enough for particle i, at most one coarser than its own.
    fn needed_level(&self, i: usize) -> u32 {
        let own = Grid::level(self.feet.nodes[i]);
        let (curvature_square, clearance_square) = self.surroundings(i);
        let mut level = own.saturating_sub(1);
        while level + 1 < self.adaptivity.levels {
            let spacing = self.config.grid.spacing_at(level);
            let share = if level < own { TUNING.coarsening_share } else { 1.0 };
            let limit = (share * self.adaptivity.curvature_constant).powi(2);
            let is_fine = curvature_square * spacing * spacing < limit;
            if is_fine && clearance_square >= (TUNING.clearance * spacing).powi(2) {
                break;
            }
            level += 1;
        }
        level
    }

    /// Squares of the largest curvature about particle i, by the turn of normals, and of the distance to another segment.
    fn surroundings(&self, i: usize) -> (f64, f64) {
        let Self { feet, cells, config, .. } = self;
        let (x, n, spacing) = (&feet.positions[i], &feet.normals[i], config.grid.spacing_of(feet.nodes[i]));
        let turn_squares = TUNING.turn_range.map(|reach| (reach * spacing).powi(2));
        let (mut bend, mut clear) = (0.0_f64, f64::INFINITY);
        cells.for_each_within(x, TUNING.clearance * 2.0 * spacing, |j, _, square| {
            if !config.segments.match_labels(feet, i, j) || feet.normals[j].dot(n) <= config.method.cosine {
                clear = clear.min(square);
            } else if square >= turn_squares[0] && square <= turn_squares[1] {
                bend = bend.max((feet.normals[j] - n).norm_squared() / square);
            }
        });
        (bend, clear)
    }
}

#[cfg(test)]
mod tests {
    use super::{Adaptivity, Grid, RINGS, Refinement, TUNING};
    use crate::geometry::surfaces::{Ball, Cuboid};
    use crate::geometry::{Surface, Vector};
    use crate::schemes::grid_based_particle::fixtures::{SPACING, config};
    use crate::schemes::grid_based_particle::laws::NormalSpeed;
    use crate::schemes::grid_based_particle::system::FrontSystem;

    /// Levels and positions of the foot points of surfaces on a refined grid.
    fn levels_of(surfaces: &[Box<dyn Surface<2>>], levels: u32, curvature_constant: f64) -> Vec<(u32, Vector<2>)> {
        let mut config = config::<2, 1>(NormalSpeed { speed: 1.0 });
        config.method.adaptivity = Some(Adaptivity { levels, curvature_constant });
        let system = FrontSystem::from_surfaces(surfaces, config);
        system.feet.nodes.iter().map(|node| Grid::level(*node)).zip(system.feet.positions).collect()
    }

    fn circle(x: f64, radius: f64) -> Box<dyn Surface<2>> {
        Box::new(Ball { center: Vector::<2>::new(x, 0.0), radius })
    }

    /// A circle of radius r needs the first level whose spacing is less than c r.
    #[test]
    fn the_level_follows_the_curvature() {
        for (constant, level) in [(0.2, 0), (0.08, 1), (0.04, 2), (0.001, 3)] {
            let found = levels_of(&[circle(0.0, 0.2)], 4, constant);
            assert!(!found.is_empty() && found.iter().all(|(found, _)| *found == level), "{constant}: {found:?}");
        }
    }

    #[test]
    fn corners_and_narrow_passages_are_refined_and_straight_sides_are_not() {
        let square = Cuboid { center: Vector::<2>::zeros(), size: Vector::<2>::repeat(0.8) };
        for (level, x) in levels_of(&[Box::new(square)], 3, 0.05) {
            let from_corner = x.map(|c| 0.4 - c.abs()).norm();
            assert!(level == 2 || from_corner > SPACING, "{level} at {x}");
            assert!(level == 0 || from_corner < 8.0 * SPACING, "{level} at {x}");
        }
        let gap = 0.8 * TUNING.clearance * SPACING;
        let near = levels_of(&[circle(-0.4 - 0.5 * gap, 0.4), circle(0.4 + 0.5 * gap, 0.4)], 2, 0.5);
        let level_at = |place: Vector<2>| {
            near.iter().min_by(|a, b| (a.1 - place).norm().total_cmp(&(b.1 - place).norm())).unwrap().0
        };
        assert_eq!((level_at(Vector::<2>::zeros()), level_at(Vector::<2>::new(-0.8, 0.0))), (1, 0));
    }

    #[test]
    fn a_row_is_found_from_anywhere() {
        let split = vec![3, 5, 9, 10, 11, 40, 41, 90];
        let refinement = Refinement { split: split.clone(), ..Refinement::default() };
        for near in 0..12 {
            for node in 0..100 {
                assert_eq!(refinement.first_from(near, node), split.partition_point(|at| *at < node), "{near} {node}");
            }
        }
        assert_eq!(Refinement::default().first_from(7, 1), 0);
    }

    #[test]
    fn rings_are_the_cells_of_boxes_each_once_and_in_order() {
        let cells = [[0_i64, 0, 5], [1, 0, 5], [4, 2, 5], [-9, 3, -7], [4, 9, 5]];
        let mut refinement =
            Refinement { occupied: cells.map(|at| Grid::node(&at, 2)).to_vec(), ..Refinement::default() };
        refinement.occupied.sort_unstable();
        refinement.add_rings::<3>();
        let mut expected = Vec::new();
        let rings = RINGS.cast_signed();
        for at in cells {
            Grid::for_each_in(&at.map(|c| c - rings), &at.map(|c| c + rings), |at| expected.push(Grid::node(at, 2)));
        }
        expected.sort_unstable();
        expected.dedup();
        assert_eq!(refinement.occupied, expected);
    }
}
