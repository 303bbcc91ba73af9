//! Search by looking at every point, the slow reference for the other searches.

use super::NeighborSearch;
use crate::geometry::{Domain, Vector};

/// A search that visits all points in their given order.
#[derive(Debug, Clone)]
pub struct BruteForce<'a, const D: usize> {
    /// Domain, which gives displacements along periodic axes.
    pub domain: &'a Domain<D>,
    /// Points to search.
    pub points: &'a [Vector<D>],
}

impl<const D: usize> NeighborSearch<D> for BruteForce<'_, D> {
    fn for_each_within(&self, x: &Vector<D>, radius: f64, mut visit: impl FnMut(usize, &Vector<D>, f64)) {
        for (j, y) in self.points.iter().enumerate() {
            let dx = self.domain.displacement(x, y);
            let r2 = dx.norm_squared();
            if r2 <= radius * radius {
                visit(j, &dx, r2);
            }
        }
    }

    fn nearest(&self, x: &Vector<D>, cutoff: f64) -> Option<(usize, f64)> {
        let mut best = (usize::MAX, cutoff * cutoff);
        self.for_each_within(x, cutoff, |j, _, r2| {
            if r2 < best.1 || r2 <= best.1 && j < best.0 {
                best = (j, r2);
            }
        });
        (best.0 != usize::MAX).then(|| (best.0, best.1.sqrt()))
    }
}
