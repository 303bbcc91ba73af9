//! The moment conditions of up to four points, one per lane: one factorization, then one solution per functional.

use super::basis::Basis;
use crate::linear_algebra::least_squares::LeastSquares;
use crate::linear_algebra::normal_equations::{LaneSystems, packed_row};
use crate::linear_algebra::number::{LANES, Lanes};

/// A neighbor in the support of a point.
#[derive(Debug, Clone, Copy)]
pub struct Node<const M: usize> {
    /// Index of the point whose value the node takes.
    pub index: u32,
    /// Coordinates relative to the center, divided by the radius of the support.
    pub at: [f64; M],
    /// Weight in the fit, not negative.
    pub window: f64,
    /// Height over the plane of the chart, divided by the radius of the support.
    pub height: f64,
}

/// A condition on a fit: its derivative vanishes along a direction at a place, as at an edge without flux.
#[derive(Debug, Clone, Copy)]
pub struct SlopeCondition<const M: usize> {
    /// Coordinates relative to the center, divided by the radius of the support.
    pub at: [f64; M],
    /// Direction, of length one or less where it leaves the plane of the chart.
    pub direction: [f64; M],
    /// Weight in the fit, not negative.
    pub window: f64,
}

/// Workspace of the fits of up to four points.
#[derive(Debug, Default)]
pub(super) struct MomentFit<const M: usize> {
    systems: LaneSystems,
    /// The neighbors in the support of each lane.
    pub near: [Vec<Node<M>>; LANES],
    /// Conditions on the slopes of each lane.
    pub slopes: [Vec<SlopeCondition<M>>; LANES],
    /// Values of the basis functions, node by node.
    values: Vec<Lanes>,
    /// Weights of the nodes in the fit.
    windows: Vec<Lanes>,
    /// Right-hand side, which a solution replaces.
    pub solution: Vec<Lanes>,
    /// Weights of the nodes for the last functional.
    pub weights: Vec<Lanes>,
    /// Workspace of the rank-revealing solution of a single lane.
    dense: LeastSquares,
    row: Vec<f64>,
}

impl<const M: usize> MomentFit<M> {
    /// Computes the moment matrices Σ W p pᵀ of the present supports and factorizes them. Returns the smallest pivot
    /// ratio of each lane.
    pub fn factorize(&mut self, basis: &Basis<M>) -> [f64; LANES] {
        self.accumulate(basis);
        self.systems.factorize().to_array()
    }

    /// Whether any lane has conditions on its slopes.
    pub fn has_slopes(&self) -> bool {
        self.slopes.iter().any(|slopes| !slopes.is_empty())
    }

    /// Does the same with Σ W s sᵀ of the conditions added, where s are the slopes of the functions. Solutions then keep to
    /// the conditions as far as their weights say.
    pub fn factorize_with_slopes(&mut self, basis: &Basis<M>) -> [f64; LANES] {
        self.accumulate(basis);
        let mut values = Vec::new();
        for (lane, slopes) in self.slopes.iter().enumerate() {
            for SlopeCondition { at, direction, window } in slopes {
                basis.slopes(*at, *direction, &mut values);
                let matrix = self.systems.matrix_mut();
                for (a, value) in values.iter().enumerate() {
                    for (entry, other) in matrix[packed_row(a)..=packed_row(a) + a].iter_mut().zip(&values[..=a]) {
                        entry.as_mut_array()[lane] += window * value * other;
                    }
                }
            }
        }
        self.systems.factorize().to_array()
    }

    /// Computes the moment matrices.
    fn accumulate(&mut self, basis: &Basis<M>) {
        let number = basis.size();
        let rows = self.near.iter().map(Vec::len).max().unwrap_or(0);
        self.systems.reset(number);
        self.systems.matrix_mut().fill(Lanes::splat(0.0));
        self.values.resize(rows * number, Lanes::splat(0.0));
        self.windows.clear();
        for k in 0..rows {
            let (mut x, mut window) = ([[0.0; LANES]; M], [0.0; LANES]);
            for (lane, near) in self.near.iter().enumerate() {
                if let Some(node) = near.get(k) {
                    window[lane] = node.window;
                    for (x, at) in x.iter_mut().zip(node.at) {
                        x[lane] = at;
                    }
                }
            }
            let (x, window) = (x.map(Lanes::new), Lanes::new(window));
            let values = &mut self.values[k * number..(k + 1) * number];
            basis.values(x, values);
            self.windows.push(window);
            let matrix = self.systems.matrix_mut();
            for (a, value) in values.iter().enumerate() {
                let weighted = window * *value;
                let row = &mut matrix[packed_row(a)..=packed_row(a) + a];
                for (entry, other) in row.iter_mut().zip(&values[..=a]) {
                    *entry = weighted.mul_add(*other, *entry);
                }
            }
        }
    }

    /// Fits the heights of the nodes. The coefficients are then in `solution`.
    pub fn solve_heights(&mut self, number: usize) {
        self.solution.clear();
        self.solution.resize(number, Lanes::splat(0.0));
        for (k, (values, window)) in self.values.chunks_exact(number).zip(&self.windows).enumerate() {
            let height = Lanes::new(std::array::from_fn(|lane| self.near[lane].get(k).map_or(0.0, |n| n.height)));
            let weighted = height * *window;
            for (sum, value) in self.solution.iter_mut().zip(values) {
                *sum = weighted.mul_add(*value, *sum);
            }
        }
        self.systems.solve(&mut self.solution);
    }

    /// Solves for the functional in `solution` and computes the weights W_j z·p(x_j) of all nodes, where z is the
    /// solution.
    pub fn solve(&mut self) {
        self.systems.solve(&mut self.solution);
        self.compute_weights();
    }

    /// Computes the weights of all nodes from `solution`.
    fn compute_weights(&mut self) {
        let number = self.solution.len();
        self.weights.clear();
        for (values, window) in self.values.chunks_exact(number).zip(&self.windows) {
            let products = values.iter().zip(&self.solution);
            let value = products.fold(Lanes::splat(0.0), |sum, (p, z)| p.mul_add(*z, sum));
            self.weights.push(*window * value);
        }
    }

    /// Solves one lane with a rank-deficient moment matrix by a rank-revealing decomposition.
    ///
    /// `functional` holds the values of the functional for the basis functions. The weights are written to the given
    /// lane of `weights`. Returns the largest violation of a moment condition, relative to the largest value of the
    /// functional.
    pub fn solve_low_rank(&mut self, lane: usize, functional: &[f64]) -> f64 {
        let number = functional.len();
        let count = self.near[lane].len();
        let value = |k: usize, a: usize| self.values[k * number + a].as_array()[lane];
        let window = |k: usize| self.windows[k].as_array()[lane];
        self.dense.reset(number, number);
        for (a, wanted) in functional.iter().enumerate() {
            self.row.clear();
            self.row
                .extend((0..number).map(|b| (0..count).map(|k| window(k) * value(k, a) * value(k, b)).sum::<f64>()));
            self.dense.set_row(a, &self.row, *wanted);
        }
        let (_, z) = self.dense.solve();
        self.weights.resize(self.windows.len(), Lanes::splat(0.0));
        for k in 0..count {
            let product: f64 = (0..number).map(|a| value(k, a) * z[a]).sum();
            self.weights[k].as_mut_array()[lane] = window(k) * product;
        }
        let moment = |a: usize| (0..count).map(|k| self.weights[k].as_array()[lane] * value(k, a)).sum::<f64>();
        let violation = (0..number).map(|a| (moment(a) - functional[a]).abs()).fold(0.0, f64::max);
        violation / functional.iter().fold(f64::MIN_POSITIVE, |largest, f| largest.max(f.abs()))
    }
}
