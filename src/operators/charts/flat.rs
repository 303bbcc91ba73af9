//! DC-PSE in flat space (Surface DC-PSE, section 2), with the coordinates of the plane or of space.
//!
//! The window 1 − r²/r_c² is wide, as in the paper. Narrow windows are more accurate on surfaces at rest. With moving
//! particles they depend on few neighbors and make flows unstable.

use super::{Chart, Functional, Heights, Node, cartesian_terms};
use crate::geometry::Vector;
use crate::neighbors::{CellList, NeighborSearch};

/// The chart of points in a domain.
#[derive(Debug)]
pub struct FlatChart<'a, const D: usize> {
    points: &'a [Vector<D>],
    cells: &'a CellList<D>,
}

impl<'a, const D: usize> FlatChart<'a, D> {
    /// The chart of points with the cell list of these points.
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
        // `dx` is the shortest displacement x_j − x_i in a periodic domain.
        self.cells.for_each_within(&self.points[i], radius, |j, dx, square| {
            if j != i {
                let window = (1.0 - square * inverse * inverse).max(0.0);
                near.push(Node { index: j as u32, at: (dx * inverse).into(), window, height: 0.0 });
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
