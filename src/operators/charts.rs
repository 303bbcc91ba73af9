//! Charts: the neighbors of a point and their coordinates for a fit, one file per chart.
//!
//! A [`TangentChart`] uses the tangent plane of a surface, [`NormalCopies`] uses copies of surface points along their
//! normals, and a [`FlatChart`] uses the coordinates of space.

pub mod flat;
pub mod normal_copies;
pub mod tangent;

pub use flat::FlatChart;
pub use normal_copies::NormalCopies;
pub use tangent::TangentChart;

pub use super::moment_fit::Node;

/// A linear functional of a field at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Functional<const M: usize> {
    /// Partial derivative ∂^α in the coordinates of the chart.
    Partial([u8; M]),
    /// Laplace–Beltrami operator Δ_S.
    LaplaceBeltrami,
    /// Component of the surface gradient ∇_S along an axis of space.
    Gradient(usize),
}

/// Derivatives of the height h of a surface over the plane of a chart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heights<const M: usize> {
    /// Slopes h_a, dimensionless.
    pub first: [f64; M],
    /// Second derivatives h_ab, in 1/length.
    pub second: [[f64; M]; M],
}

/// Neighbors and coordinates around the points of a cloud.
pub trait Chart<const M: usize>: Sync {
    /// Number of points that get a row.
    fn count(&self) -> usize;

    /// Replaces `near` by the neighbors of point i within `radius`.
    ///
    /// Nodes with the same index must follow one another. Nodes with the index i are copies of the center: they take
    /// part in the fit and have no weight in the row. With `is_last_resort`, nodes on the wrong sheet are accepted too.
    fn gather(&self, i: usize, radius: f64, is_last_resort: bool, near: &mut Vec<Node<M>>);

    /// Ratio of the support radius of point i to the nominal radius.
    fn scale(&self, _i: usize) -> f64 {
        1.0
    }

    /// Whether functionals depend on the heights of the surface over the plane of the chart.
    fn needs_heights(&self) -> bool {
        false
    }

    /// Appends the functional as a sum of partial derivatives ∂^α, each with its coefficient.
    fn terms(&self, functional: Functional<M>, i: usize, heights: Option<&Heights<M>>, terms: &mut Vec<([u8; M], f64)>);

    /// Whether a support with too few neighbors may grow.
    fn may_grow(&self) -> bool {
        true
    }
}

/// Multi-index of ∂_a.
pub(super) fn first<const M: usize>(a: usize) -> [u8; M] {
    std::array::from_fn(|d| u8::from(d == a))
}

/// Multi-index of ∂_a ∂_b.
pub(super) fn second<const M: usize>(a: usize, b: usize) -> [u8; M] {
    std::array::from_fn(|d| u8::from(d == a) + u8::from(d == b))
}

/// Appends a functional in Cartesian coordinates as a sum of partial derivatives.
fn cartesian_terms<const D: usize>(functional: Functional<D>, terms: &mut Vec<([u8; D], f64)>) {
    match functional {
        Functional::Partial(alpha) => terms.push((alpha, 1.0)),
        Functional::LaplaceBeltrami => terms.extend((0..D).map(|d| (second(d, d), 1.0))),
        Functional::Gradient(axis) => terms.push((first(axis), 1.0)),
    }
}
