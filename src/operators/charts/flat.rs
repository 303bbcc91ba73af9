//! Points of the plane or of space as they are: DC-PSE in flat space (Surface DC-PSE paper, section 2).
//!
//! Windows are 1 − r²/r_c²: wide, as the paper's are. Narrow ones, which are more exact on surfaces at rest, make fits of moving
//! particles follow few neighbors and flows unstable.

use super::{Chart, Functional, Heights, Node, cartesian_terms};
use crate::geometry::Vector;
use crate::neighbors::{CellList, NeighborSearch};

/// Points of a domain.
#[derive(Debug)]
pub struct FlatChart<'a, const D: usize> {
    points: &'a [Vector<D>],
    cells: &'a CellList<D>,
}

impl<'a, const D: usize> FlatChart<'a, D> {
    /// Of points and the cells that they were sorted into.
    #[must_use]
    pub fn new(points: &'a [Vector<D>], cells: &'a CellList<D>) -> Self {
        Self { points, cells }
    }
}

impl<const D: usize> Chart<D> for FlatChart<'_, D> {
    fn count(&self) -> usize {
        self.points.len()
    }

    fn gather(&self, i: usize, radius: f64, _is_last_resort: bool, near: &mut Vec<Node<D>>) {
        near.clear();
        let inverse = 1.0 / radius;
        // `dx` is x_j − x_i, over the edge of a periodic domain where that is nearer.
        self.cells.for_each_within(&self.points[i], radius, |j, dx, square| {
            if j != i {
                let rest = (1.0 - square * inverse * inverse).max(0.0);
                near.push(Node { index: j as u32, at: (dx * inverse).into(), window: rest, height: 0.0 });
            }
        });
    }

    fn terms(
        &self,
        functional: Functional<D>,
        _i: usize,
        _heights: Option<&Heights<D>>,
        terms: &mut Vec<([u8; D], f64)>,
    ) {
        cartesian_terms(functional, terms);
    }
}
