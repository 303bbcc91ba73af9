//! The underlying grid: a quadtree or octree of cells, whose centers are the grid points, named by one number each.
//!
//! Level 0 has the multiples of the spacing; a cell of level l is halved along each axis into those of level l + 1 (GBPM 3.5).

use crate::geometry::Vector;

/// Number of a grid point: its level, then its coordinates in spacings of the level. Ascending numbers follow space.
pub type Node = u64;

/// Bits of the number of a grid point that hold its level.
const LEVEL_BITS: u32 = 4;
/// Largest number of levels. Each further level doubles the time to visit a row of cells.
pub const MOST_LEVELS: u32 = 8;

/// Bits of the number of a grid point that hold one coordinate.
const fn bits<const D: usize>() -> u32 {
    (u64::BITS - LEVEL_BITS) / D as u32
}

/// Offset that makes all coordinates positive: half their number.
const fn offset<const D: usize>() -> i64 {
    1 << (bits::<D>() - 1)
}

/// Center of cell 0 of a level, in spacings of the level: cells of all levels have common faces.
fn shift(level: u32) -> f64 {
    0.5 * (1.0 - f64::from(1_u32 << level))
}

/// The underlying grid: one lattice per level, each level with half the spacing of the level before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// h of level 0, the coarsest.
    pub spacing: f64,
}

impl Grid {
    /// The spacing of a level.
    #[must_use]
    pub fn spacing_at(&self, level: u32) -> f64 {
        self.spacing / f64::from(1_u32 << level)
    }

    /// The spacing of the level of a grid point.
    #[must_use]
    pub fn spacing_of(&self, node: Node) -> f64 {
        self.spacing_at(Self::level(node))
    }

    /// The level of a grid point.
    #[must_use]
    pub const fn level(node: Node) -> u32 {
        (node >> (u64::BITS - LEVEL_BITS)) as u32
    }

    /// The position of a grid point.
    #[must_use]
    pub fn place<const D: usize>(&self, node: Node) -> Vector<D> {
        let level = Self::level(node);
        self.center(&Self::coordinates(node), level)
    }

    /// The position with some coordinates.
    #[must_use]
    pub fn center<const D: usize>(&self, at: &[i64; D], level: u32) -> Vector<D> {
        let (spacing, shift) = (self.spacing_at(level), shift(level));
        Vector::<D>::from_fn(|d, _| (at[d] as f64 + shift) * spacing)
    }

    /// The coordinates of the grid point nearest to a place, whose cell contains the place; None beyond the end of the grid.
    #[must_use]
    pub fn nearest<const D: usize>(&self, x: &Vector<D>, level: u32) -> Option<[i64; D]> {
        let (spacing, shift) = (self.spacing_at(level), shift(level));
        let mut at = [0; D];
        for d in 0..D {
            let coordinate = (x[d] / spacing - shift).round();
            if coordinate.is_nan() || coordinate.abs() > (offset::<D>() - 8) as f64 {
                return None;
            }
            at[d] = coordinate as i64;
        }
        Some(at)
    }

    /// The number of a grid point.
    #[must_use]
    pub fn node<const D: usize>(at: &[i64; D], level: u32) -> Node {
        let level = u64::from(level) << (u64::BITS - LEVEL_BITS);
        at.iter()
            .enumerate()
            .fold(level, |node, (d, c)| node | ((c + offset::<D>()) as u64) << (bits::<D>() * d as u32))
    }

    /// Difference between the numbers of two cells next to each other along an axis.
    pub(super) fn next_along<const D: usize>(axis: usize) -> Node {
        1 << (bits::<D>() * axis as u32)
    }

    /// The coordinates of a grid point.
    #[must_use]
    pub fn coordinates<const D: usize>(node: Node) -> [i64; D] {
        let mask = (1_u64 << bits::<D>()) - 1;
        std::array::from_fn(|d| (node >> (bits::<D>() * d as u32) & mask) as i64 - offset::<D>())
    }

    /// Calls `visit` with the coordinates of all cells of a box, both corners included.
    pub fn for_each_in<const D: usize>(low: &[i64; D], high: &[i64; D], mut visit: impl FnMut(&[i64; D])) {
        let mut at = *low;
        if (0..D).any(|d| low[d] > high[d]) {
            return;
        }
        loop {
            visit(&at);
            let Some(d) = (0..D).find(|d| at[*d] < high[*d]) else { return };
            at[..d].copy_from_slice(&low[..d]);
            at[d] += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Grid;
    use crate::geometry::Vector;

    #[test]
    fn a_number_is_a_place_and_back() {
        let grid = Grid { spacing: 0.1 };
        for level in [0, 1, 4] {
            for at in [[0, 0, 0], [-5, 7, 1000], [500_000, -500_000, 3]] {
                let node = Grid::node(&at, level);
                assert_eq!((Grid::level(node), Grid::coordinates(node)), (level, at));
                assert_eq!(grid.nearest(&grid.place::<3>(node), level), Some(at));
            }
        }
        assert_eq!(grid.nearest(&Vector::<2>::new(1e9, 0.0), 0), None);
        assert_eq!(grid.nearest(&Vector::<2>::new(f64::NAN, 0.0), 0), None);
    }

    #[test]
    fn a_cell_is_that_of_its_quarters() {
        let grid = Grid { spacing: 0.5 };
        for level in 0..5 {
            let parent = [3_i64, -8];
            let center = grid.center(&parent, level);
            let mut sum = Vector::<2>::zeros();
            Grid::for_each_in(&[6, -16], &[7, -15], |at| {
                assert_eq!([at[0] >> 1, at[1] >> 1], parent);
                sum += grid.center(at, level + 1);
            });
            assert!((0.25 * sum - center).norm() < 1e-15);
        }
        assert_eq!(grid.center(&[3, -8], 0), Vector::<2>::new(1.5, -4.0));
    }

    #[test]
    fn a_box_has_all_its_cells_once() {
        let mut found = Vec::new();
        Grid::for_each_in(&[-1, 0, 4], &[1, 0, 5], |at| found.push(*at));
        assert_eq!(found, [[-1, 0, 4], [0, 0, 4], [1, 0, 4], [-1, 0, 5], [0, 0, 5], [1, 0, 5]]);
        Grid::for_each_in(&[1], &[0], |_| found.clear());
        assert_eq!(found.len(), 6);
    }
}
