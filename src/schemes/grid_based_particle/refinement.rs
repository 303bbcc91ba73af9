//! Where the grid is finer, and where it is not any more (GBPM 3.5): by the curvature against the local spacing, and where another
//! segment is close (GBPM 3.6, remark 1).
//!
//! Nothing is remembered but the levels of the foot-points: each step finds anew what its particles need, which may be one level
//! coarser than what they have. Both refinement and coarsening come out of that.

use super::foot_points::FootPoints;
use super::grid::{Grid, MOST_LEVELS, Node};
use super::method::FrontMethod;
use super::segments::Segments;
use crate::geometry::Vector;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted, one_by_one};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSliceMut};

/// Levels and what asks for them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adaptivity {
    /// How many levels there are.
    pub levels: u32,
    /// c: the grid is fine enough where |κ| h < c (GBPM eq. 16).
    pub curvature_constant: f64,
}

/// Between so many spacings a turn of the normals counts as curvature: a corner is one. Closer by, rounding and the errors of fits turn
/// normals as much as the front does.
const TURN_REACH: [f64; 2] = [0.25, 1.5];
/// Spacings that another segment is away at least.
const CLEARANCE: f64 = 2.0;
/// A level is given up where the coarser one fulfils the criterion with so much of its c: so levels do not flicker.
const COARSENED: f64 = 0.7;
/// So many rings of cells about the cell of a particle that needs finer ones are split: no support of a coarse cell may reach to where
/// the front turns faster.
const RINGS: Node = 3;
/// Every number up to twice as many is a sum of some of these, each taken once.
const FARTHER: [Node; 3] = [1, 2, 3];

/// Cells of a level about a particle, and how far its grid points may be from it across the front and along it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window<const D: usize> {
    pub low: [i64; D],
    pub high: [i64; D],
    pub across: f64,
    pub along: f64,
    /// The spacing of the level, and the first of its grid points as the particle sees it.
    pub spacing: f64,
    pub first: Vector<D>,
}

impl<const D: usize> Window<D> {
    /// A grid point as the particle sees it.
    pub fn seen_at(&self, at: &[i64; D]) -> Vector<D> {
        Vector::<D>::from_fn(|d, _| self.first[d] + (at[d] - self.low[d]) as f64 * self.spacing)
    }
}

/// Where the last row of each level was found: the next one is close.
pub(super) type Hints = [usize; MOST_LEVELS as usize];

/// The cells that are split, of all levels, in order.
#[derive(Debug, Default)]
pub(super) struct Refinement {
    split: Vec<Node>,
    /// The level that each particle needs.
    needs: Vec<u32>,
    /// Cells with particles that need finer ones.
    occupied: Vec<Node>,
    /// These and the rings about them in the making.
    united: Vec<Node>,
}

impl Refinement {
    /// Finds the split cells anew from particles sorted into cells.
    pub fn renew<const D: usize>(
        &mut self,
        feet: &FootPoints<D>,
        cells: &CellList<D>,
        (grid, method): (&Grid, &FrontMethod),
        segments: Segments,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        self.split.clear();
        let Some(adaptivity) = method.adaptivity else { return Ok(()) };
        self.needs.clear();
        self.needs.resize(feet.len(), 0);
        one_by_one(self.needs.par_chunks_mut(BLOCK).enumerate()).for_each(|(block, needs)| {
            for (k, need) in needs.iter_mut().enumerate() {
                if interrupt.is_raised() {
                    return;
                }
                *need = needed_level(feet, cells, (grid, method.cosine), adaptivity, segments, block * BLOCK + k);
            }
        });
        interrupt.check()?;
        // Level by level the cells that particles with finer needs lie in, each once, and the rings about them.
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

    /// Adds the rings about the occupied cells of a level, which stay in order: beginning with the lowest corners, along each axis the cells
    /// are united with themselves so many cells farther.
    fn add_rings<const D: usize>(&mut self) {
        let corner: Node = (0..D).map(|d| RINGS * Grid::next_along::<D>(d)).sum();
        self.occupied.iter_mut().for_each(|node| *node -= corner);
        for d in 0..D {
            for farther in FARTHER {
                unite(&self.occupied, farther * Grid::next_along::<D>(d), &mut self.united);
                std::mem::swap(&mut self.occupied, &mut self.united);
            }
        }
    }

    /// Whether any cell of a level has parts.
    pub fn splits_level(&self, level: u32) -> bool {
        let place = self.split.partition_point(|node| Grid::level(*node) < level);
        self.split.get(place).is_some_and(|node| Grid::level(*node) == level)
    }

    /// How many cells have parts.
    pub fn count(&self) -> usize {
        self.split.len()
    }

    /// Whether a cell has parts.
    pub fn is_split(&self, node: Node) -> bool {
        !self.split.is_empty() && self.split.binary_search(&node).is_ok()
    }

    /// Calls for the cells without parts, of all levels, in the window of their level; where the grid ends there is no window.
    pub fn for_each_leaf_in<const D: usize>(
        &self,
        hints: &mut Hints,
        window: impl Fn(u32) -> Option<Window<D>>,
        mut visit: impl FnMut(&[i64; D], u32, &Window<D>),
    ) {
        let Some(first) = window(0) else { return };
        self.descend(&first, (&first.low, &first.high), 0, hints, &window, &mut visit);
    }

    /// The place of the first split cell that is not before a node, near one known: longer and longer strides, then halves.
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

    fn descend<const D: usize>(
        &self,
        here: &Window<D>,
        (low, high): (&[i64; D], &[i64; D]),
        level: u32,
        hints: &mut Hints,
        window: &impl Fn(u32) -> Option<Window<D>>,
        visit: &mut impl FnMut(&[i64; D], u32, &Window<D>),
    ) {
        let mut parts = None;
        // The first split cell that is not before the one at hand: cells of a row follow each other, so it is searched once a row.
        let mut next = 0;
        Grid::for_each_in(low, high, |at| {
            let node = Grid::node(at, level);
            if at[0] == low[0] {
                next = self.first_from(hints[level as usize], node);
                hints[level as usize] = next;
            }
            let is_split = self.split.get(next) == Some(&node);
            next += usize::from(is_split);
            if !is_split {
                visit(at, level, here);
            } else if let Some(below) = parts.get_or_insert_with(|| window(level + 1)) {
                let low = std::array::from_fn(|d| (2 * at[d]).max(below.low[d]));
                let high = std::array::from_fn(|d| (2 * at[d] + 1).min(below.high[d]));
                self.descend(below, (&low, &high), level + 1, hints, window, visit);
            }
        });
    }

    /// Whether a cell is there and has no parts.
    pub fn is_leaf<const D: usize>(&self, at: &[i64; D], level: u32) -> bool {
        let is_there = level == 0 || self.is_split(Grid::node(&at.map(|c| c >> 1), level - 1));
        is_there && !self.is_split(Grid::node(at, level))
    }

    /// The grid point of the cell without parts that a place lies in; None where the grid ends.
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

/// Numbers in order and the same numbers greater by a shift, each once and in order.
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

/// The coarsest level that does for a particle, at most one coarser than its own.
fn needed_level<const D: usize>(
    feet: &FootPoints<D>,
    cells: &CellList<D>,
    (grid, cosine): (&Grid, f64),
    adaptivity: Adaptivity,
    segments: Segments,
    i: usize,
) -> u32 {
    let own = Grid::level(feet.nodes[i]);
    let (x, n, spacing) = (&feet.positions[i], &feet.normals[i], grid.spacing_at(own));
    let (turn_squares, reach) = (TURN_REACH.map(|reach| (reach * spacing).powi(2)), CLEARANCE * 2.0 * spacing);
    // Squares: of the curvature, and of the distance to another segment.
    let (mut bend, mut clear) = (0.0_f64, f64::INFINITY);
    cells.for_each_within(x, reach, |j, _, square| {
        if !segments.match_labels(feet, i, j) || feet.normals[j].dot(n) <= cosine {
            clear = clear.min(square);
        } else if square >= turn_squares[0] && square <= turn_squares[1] {
            bend = bend.max((feet.normals[j] - n).norm_squared() / square);
        }
    });
    let mut level = own.saturating_sub(1);
    while level + 1 < adaptivity.levels {
        let spacing = grid.spacing_at(level);
        let share = if level < own { COARSENED } else { 1.0 };
        let is_fine = bend * spacing * spacing < (share * adaptivity.curvature_constant).powi(2);
        if is_fine && clear >= (CLEARANCE * spacing).powi(2) {
            break;
        }
        level += 1;
    }
    level
}

#[cfg(test)]
mod tests {
    use super::{Grid, RINGS, Refinement};

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
