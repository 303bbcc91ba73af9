//! How the points about a point become coordinates of a fit. One file a chart.

pub mod flat;
pub mod normal_copies;
pub mod tangent;

pub use flat::FlatChart;
pub use normal_copies::NormalCopies;
pub use tangent::TangentChart;

pub use super::moment_fit::Node;

/// What is asked of a field at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Functional<const M: usize> {
    /// ∂^α in the coordinates of the chart.
    Partial([u8; M]),
    /// Δ_S.
    LaplaceBeltrami,
    /// A component of ∇_S in space.
    Gradient(usize),
}

/// Slopes and second derivatives of the surface over the plane of a chart, in lengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heights<const M: usize> {
    /// h_a.
    pub first: [f64; M],
    /// h_ab.
    pub second: [[f64; M]; M],
}

/// Coordinates about the points of a cloud.
pub trait Chart<const M: usize>: Sync {
    /// Points that get a row.
    fn count(&self) -> usize;

    /// What lies about point i within `reach`: nodes of one index follow one another; those of index i itself are copies of the
    /// center, which take part in the fit and have no weight in the row. As a last resort also what would not belong to it.
    fn gather(&self, i: usize, radius: f64, is_last_resort: bool, near: &mut Vec<Node<M>>);

    /// The support of point i by that of the others.
    fn scale(&self, _i: usize) -> f64 {
        1.0
    }

    /// Whether a functional depends on the heights of the surface over the plane of the chart.
    fn needs_heights(&self) -> bool {
        false
    }

    /// The functional as a sum of ∂^α in lengths, with the coefficient of each.
    fn terms(&self, functional: Functional<M>, i: usize, heights: Option<&Heights<M>>, terms: &mut Vec<([u8; M], f64)>);

    /// Whether a support may grow when it does not hold enough.
    fn may_grow(&self) -> bool {
        true
    }
}

/// The multi-index of ∂_a.
fn first<const M: usize>(a: usize) -> [u8; M] {
    std::array::from_fn(|d| u8::from(d == a))
}

/// The multi-index of ∂_a ∂_b.
fn second<const M: usize>(a: usize, b: usize) -> [u8; M] {
    std::array::from_fn(|d| u8::from(d == a) + u8::from(d == b))
}

/// A functional in the coordinates of space themselves.
fn cartesian_terms<const D: usize>(functional: Functional<D>, terms: &mut Vec<([u8; D], f64)>) {
    match functional {
        Functional::Partial(alpha) => terms.push((alpha, 1.0)),
        Functional::LaplaceBeltrami => terms.extend((0..D).map(|d| (second(d, d), 1.0))),
        Functional::Gradient(axis) => terms.push((first(axis), 1.0)),
    }
}
