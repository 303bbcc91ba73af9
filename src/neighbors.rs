//! Neighbor searches.
//!
//! A [`CellList`] answers searches around any point. [`Pencils`] serve sums over all pairs of neighbors. [`BruteForce`]
//! looks at every point and is the reference of both in tests. A [`KdTree`] finds the nearest points of clouds whose density varies.

pub mod brute_force;
pub mod cell_list;
pub mod kd_tree;
pub mod pencils;

pub use brute_force::BruteForce;
pub use cell_list::CellList;
pub use kd_tree::KdTree;
pub use pencils::Pencils;

use crate::geometry::Vector;

/// A point that a search found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbor<const D: usize> {
    /// Squared distance r².
    pub r2: f64,
    /// Index j of the point.
    pub index: usize,
    /// Displacement x_j − x, the shortest one in a periodic domain.
    pub dx: Vector<D>,
}

/// Search over a fixed set of points. The order of visits depends on the points alone.
pub trait NeighborSearch<const D: usize> {
    /// Calls `visit(j, dx, r²)` for every point j with `r ≤ radius`, where `dx = x_j − x` is the shortest displacement.
    fn for_each_within(&self, x: &Vector<D>, radius: f64, visit: impl FnMut(usize, &Vector<D>, f64));

    /// Replaces `found` by all points with `r ≤ radius`, in the order of [`Self::for_each_within`].
    fn gather(&self, x: &Vector<D>, radius: f64, found: &mut Vec<Neighbor<D>>) {
        found.clear();
        self.for_each_within(x, radius, |index, dx, r2| found.push(Neighbor { r2, index, dx: *dx }));
    }

    /// Index and distance of the nearest point with `r ≤ cutoff`; of equally near points the one with the smallest
    /// index.
    fn nearest(&self, x: &Vector<D>, cutoff: f64) -> Option<(usize, f64)>;
}
