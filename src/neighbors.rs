//! Which points are near a point: a cell list, pencils for loops over pairs, and brute force as the oracle of both.

pub mod brute_force;
pub mod cell_list;
pub mod pencils;

pub use brute_force::BruteForce;
pub use cell_list::CellList;
pub use pencils::Pencils;

use crate::geometry::Vector;

/// A point found near another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbor<const D: usize> {
    /// r².
    pub r2: f64,
    /// Which point.
    pub index: usize,
    /// x_j − x by the shortest way.
    pub dx: Vector<D>,
}

/// Search over a fixed set of points; the order of visits depends on the points alone.
pub trait NeighborSearch<const D: usize> {
    /// Calls `visit(j, dx, r²)` for every point j with `r ≤ radius`, `dx = x_j − x` by the shortest way.
    fn for_each_within(&self, x: &Vector<D>, radius: f64, visit: impl FnMut(usize, &Vector<D>, f64));

    /// Replaces `found` by every point with `r ≤ radius`, in the order of [`Self::for_each_within`].
    fn gather(&self, x: &Vector<D>, radius: f64, found: &mut Vec<Neighbor<D>>) {
        found.clear();
        self.for_each_within(x, radius, |index, dx, r2| found.push(Neighbor { r2, index, dx: *dx }));
    }

    /// The nearest point not farther than `reach`, as (index, distance); among equals the least index.
    fn nearest(&self, x: &Vector<D>, cutoff: f64) -> Option<(usize, f64)>;
}
