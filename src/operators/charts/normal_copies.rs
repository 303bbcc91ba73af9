//! The paper's form of Surface DC-PSE (section 3, algorithms 1 and 2): fits in space with copies of points along their
//! normals.
//!
//! The weight of a point is the sum of the weights of its copies.

use super::{Chart, Functional, Heights, Node, cartesian_terms};
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};

/// The chart of surface points with normals and their copies.
#[derive(Debug)]
pub struct NormalCopies<'a, const D: usize> {
    points: &'a [Vector<D>],
    normals: &'a [Vector<D>],
    /// Number of copies to either side.
    layers: i32,
    /// Distance of the copies.
    spacing: f64,
    cells: CellList<D>,
}

/// Ratio of the mean L1 distance of the nodes from the center to the width ε of the window (Surface DC-PSE eq. 8). The
/// value is that of the paper's program.
const SPACING_BY_WIDTH: f64 = 0.9;

impl<'a, const D: usize> NormalCopies<'a, D> {
    /// The chart of `points` with unit `normals`.
    ///
    /// - `layers`: number N_n of copies to either side.
    /// - `spacing`: distance δ_n of the copies, a length.
    /// - `radius`: radius of the support, a length.
    #[must_use]
    pub fn new(points: &'a [Vector<D>], normals: &'a [Vector<D>], layers: u32, spacing: f64, radius: f64) -> Self {
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), radius);
        Self { points, normals, layers: layers as i32, spacing, cells }
    }
}

impl<const D: usize> Chart<D> for NormalCopies<'_, D> {
    fn count(&self) -> usize {
        self.points.len()
    }

    /// Supports never grow. A rank-deficient support is solved by a rank-revealing decomposition.
    fn may_grow(&self) -> bool {
        false
    }

    fn gather(&self, i: usize, radius: f64, _is_last_resort: bool, near: &mut Vec<Node<D>>) {
        near.clear();
        let x = self.points[i];
        let inverse = 1.0 / radius;
        let mut spread = 0.0;
        let mut add = |j: usize, layer: i32| {
            let d = self.points[j] + self.normals[j] * (f64::from(layer) * self.spacing) - x;
            if d.norm_squared() <= radius * radius {
                spread += d.abs().sum() * inverse;
                near.push(Node { index: j as u32, at: (d * inverse).into(), window: 0.0, height: 0.0 });
            }
        };
        self.cells.for_each_within(&x, radius, |j, _, _| {
            if j != i {
                (-self.layers..=self.layers).for_each(|layer| add(j, layer));
            }
        });
        (-self.layers..=self.layers).filter(|layer| *layer != 0).for_each(|layer| add(i, layer));
        let width = spread / near.len().max(1) as f64 / SPACING_BY_WIDTH;
        for node in near.iter_mut() {
            let square: f64 = node.at.iter().map(|c| c * c).sum();
            node.window = (-square / (width * width)).exp();
        }
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
