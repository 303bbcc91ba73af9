//! The underlying grid: all multiples of the spacing, named by one number each.

use crate::geometry::Vector;

/// A grid point's number: its coordinates by the spacing, 21 bits each, in an order that is that of space.
pub type Node = u64;

/// Bits of one coordinate.
const BITS: u32 = 21;
/// The largest coordinate by the spacing.
const FARTHEST: f64 = ((1_u64 << (BITS - 1)) - 8) as f64;

/// The grid of all x = h (i, j, …).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// h.
    pub spacing: f64,
}

impl Grid {
    /// The place of a grid point.
    #[must_use]
    pub fn place<const D: usize>(&self, node: Node) -> Vector<D> {
        let offset = (1_i64 << (BITS - 1)) as f64;
        let mask = (1_u64 << BITS) - 1;
        Vector::<D>::from_fn(|d, _| ((node >> (BITS * d as u32) & mask) as f64 - offset) * self.spacing)
    }

    /// The coordinates of the grid point next to a place; None where the grid ends.
    #[must_use]
    pub fn nearest<const D: usize>(&self, x: &Vector<D>) -> Option<[i64; D]> {
        let mut at = [0; D];
        for d in 0..D {
            let coordinate = (x[d] / self.spacing).round();
            if coordinate.is_nan() || coordinate.abs() > FARTHEST {
                return None;
            }
            at[d] = coordinate as i64;
        }
        Some(at)
    }

    /// The number of a grid point.
    #[must_use]
    pub fn node<const D: usize>(at: &[i64; D]) -> Node {
        let offset = 1_i64 << (BITS - 1);
        at.iter().enumerate().fold(0, |node, (d, c)| node | ((c + offset) as u64) << (BITS * d as u32))
    }

    /// Calls for every grid point of the box of `reach` spacings to all sides of the nearest one.
    pub fn for_each_about<const D: usize>(&self, x: &Vector<D>, reach: i64, mut visit: impl FnMut(Node, Vector<D>)) {
        let Some(center) = self.nearest(x) else { return };
        let side = (2 * reach + 1) as usize;
        for k in 0..side.pow(D as u32) {
            let mut rest = k;
            let mut at = center;
            for c in &mut at {
                *c += (rest % side) as i64 - reach;
                rest /= side;
            }
            let place = Vector::<D>::from_fn(|d, _| at[d] as f64 * self.spacing);
            visit(Self::node(&at), place);
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
        for at in [[0, 0, 0], [-5, 7, 1000], [1_000_000, -1_000_000, 3]] {
            let node = Grid::node(&at);
            let place = grid.place::<3>(node);
            assert_eq!(grid.nearest(&place), Some(at));
        }
        assert_eq!(grid.nearest(&Vector::<2>::new(1e6, 0.0)), None);
        assert_eq!(grid.nearest(&Vector::<2>::new(f64::NAN, 0.0)), None);
    }

    #[test]
    fn a_box_about_a_place_has_all_its_points() {
        let grid = Grid { spacing: 0.5 };
        let mut found = Vec::new();
        grid.for_each_about(&Vector::<2>::new(0.6, -0.4), 1, |node, place| {
            assert_eq!(grid.place::<2>(node), place);
            found.push((place[0], place[1]));
        });
        assert_eq!(found.len(), 9);
        assert!(found.contains(&(1.0, -1.0)) && found.contains(&(0.0, 0.0)));
    }
}
