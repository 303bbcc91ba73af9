//! The intrinsic form of Surface DC-PSE (Surface DC-PSE, section 3, without the copies along normals): fits in the
//! tangent plane.
//!
//! With coordinates (X, Y) of the neighbors in the exact tangent plane, Δ_S f = f_XX + f_YY, because the metric of the
//! projection is the identity up to second order. Where normals are not exact, the heights Z(X, Y) of the surface over
//! the plane are fitted with the same weights. The metric is then g_ab = δ_ab + Z_a Z_b with the Christoffel symbols
//! Γ^c_ab = Z_c Z_ab/(1 + ‖∇Z‖²).

use super::{Chart, Functional, Heights, Node, first, second};
use crate::geometry::frame::tangents;
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};

/// Origin of the metric.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Metric {
    /// Normals are exact, and the metric is the identity.
    FromNormals,
    /// The metric comes from fitted heights over the plane.
    FromHeights,
}

/// The chart of surface points with unit normals, with M = D − 1 coordinates.
#[derive(Debug)]
pub struct TangentChart<'a, const D: usize> {
    points: &'a [Vector<D>],
    normals: &'a [Vector<D>],
    /// Number of points that get a row; they come first.
    rows: usize,
    /// Index of the point whose value each point takes, where there are mirror images.
    source: Option<&'a [u32]>,
    /// Support radius of each point relative to the nominal radius.
    scales: Option<&'a [f64]>,
    metric: Metric,
    cells: CellList<D>,
}

/// Smallest cosine between normals of neighbors as a last resort, where the surface is very coarse.
pub const SAME_SIDE: f64 = 0.05;
/// Smallest cosine between normals of neighbors. A point with a smaller cosine belongs to another sheet.
pub const SAME_SHEET: f64 = 0.5;

impl<'a, const D: usize> TangentChart<'a, D> {
    /// The chart of points with unit normals. `radius` is the nominal radius of the support, a length.
    #[must_use]
    pub fn new(points: &'a [Vector<D>], normals: &'a [Vector<D>], metric: Metric, radius: f64) -> Self {
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), radius);
        Self { points, normals, rows: points.len(), source: None, scales: None, metric, cells }
    }

    /// Declares the points from index `rows` on as mirror images, which take the value of their `source` and have no
    /// row.
    #[must_use]
    pub fn with_images(mut self, rows: usize, source: &'a [u32]) -> Self {
        (self.rows, self.source) = (rows, Some(source));
        self
    }

    /// Sets the support radius of each point relative to the nominal radius.
    #[must_use]
    pub fn with_scales(mut self, scales: &'a [f64]) -> Self {
        self.scales = Some(scales);
        self
    }
}

impl<const D: usize> TangentChart<'_, D> {
    /// Index of the point whose value point j takes.
    fn owner(&self, j: usize) -> usize {
        self.source.map_or(j, |source| source[j] as usize)
    }
}

impl<const D: usize, const M: usize> Chart<M> for TangentChart<'_, D> {
    fn count(&self) -> usize {
        self.rows
    }

    fn scale(&self, i: usize) -> f64 {
        self.scales.map_or(1.0, |scales| scales[i])
    }

    fn needs_heights(&self) -> bool {
        self.metric == Metric::FromHeights
    }

    fn gather(&self, i: usize, radius: f64, is_last_resort: bool, near: &mut Vec<Node<M>>) {
        near.clear();
        let least_cosine = if is_last_resort { SAME_SIDE } else { SAME_SHEET };
        let (x, n) = (self.points[i], self.normals[i]);
        let t = tangents::<D, M>(&n);
        let inverse = 1.0 / radius;
        self.cells.for_each_within(&x, radius, |j, _, square| {
            if j != i && self.normals[j].dot(&n) > least_cosine {
                let d = self.points[j] - x;
                let remainder = (1.0 - square * inverse * inverse).max(0.0);
                let window = remainder * remainder;
                // Points are weighted by the area that they represent. Otherwise the denser side of a support would
                // dominate.
                let area = self.scales.map_or(1.0, |scales| scales[self.owner(j)].powi(2));
                near.push(Node {
                    index: self.owner(j) as u32,
                    at: t.map(|t| d.dot(&t) * inverse),
                    window: window * window * area,
                    height: d.dot(&n) * inverse,
                });
            }
        });
    }

    fn terms(
        &self,
        functional: Functional<M>,
        i: usize,
        heights: Option<&Heights<M>>,
        terms: &mut Vec<([u8; M], f64)>,
    ) {
        tangent_terms(&self.normals[i], functional, heights, terms);
    }
}

/// Appends a functional at a point with the given unit normal as a sum of partial derivatives in its tangent plane. Without
/// `heights` the metric is the identity.
pub(in crate::operators) fn tangent_terms<const D: usize, const M: usize>(
    n: &Vector<D>,
    functional: Functional<M>,
    heights: Option<&Heights<M>>,
    terms: &mut Vec<([u8; M], f64)>,
) {
    let flat = Heights { first: [0.0; M], second: [[0.0; M]; M] };
    let h = heights.unwrap_or(&flat);
    let det = 1.0 + h.first.iter().map(|slope| slope * slope).sum::<f64>();
    let inverse = |a: usize, b: usize| f64::from(u8::from(a == b)) - h.first[a] * h.first[b] / det;
    match functional {
        Functional::Partial(alpha) => terms.push((alpha, 1.0)),
        Functional::LaplaceBeltrami => {
            // g^ab (f_ab − Γ^c_ab f_c)
            let mut trace = 0.0;
            for a in 0..M {
                for b in 0..M {
                    if heights.is_some() || a == b {
                        terms.push((second(a, b), inverse(a, b)));
                    }
                    trace += inverse(a, b) * h.second[a][b];
                }
            }
            if heights.is_some() {
                terms.extend((0..M).map(|c| (first(c), -trace * h.first[c] / det)));
            }
        }
        Functional::Gradient(axis) => {
            // g^ab f_b e_a with e_a = t_a + Z_a n
            let t = tangents::<D, M>(n);
            for b in 0..M {
                let part = (0..M).map(|a| inverse(a, b) * (t[a][axis] + h.first[a] * n[axis])).sum();
                terms.push((first(b), part));
            }
        }
    }
}
