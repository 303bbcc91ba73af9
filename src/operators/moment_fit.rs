//! The moment conditions of up to four points side by side: one factorization, then a solution a functional.

use super::basis::Basis;
use crate::linear_algebra::least_squares::LeastSquares;
use crate::linear_algebra::normal_equations::{LaneSystems, packed_row};
use crate::linear_algebra::number::{LANES, Lanes};

/// A point of a support.
#[derive(Debug, Clone, Copy)]
pub struct Node<const M: usize> {
    /// Whose value it takes.
    pub index: u32,
    /// Coordinates from the center, by the reach of the support.
    pub at: [f64; M],
    /// Weight of the fit, not negative.
    pub window: f64,
    /// Height over the chart's plane, by the reach.
    pub height: f64,
}

/// Storage for four points.
#[derive(Debug, Default)]
pub(super) struct MomentFit<const M: usize> {
    systems: LaneSystems,
    /// The support of each lane.
    pub near: [Vec<Node<M>>; LANES],
    /// Values of the functions, node by node.
    values: Vec<Lanes>,
    windows: Vec<Lanes>,
    /// Right-hand side, then the solution.
    pub solution: Vec<Lanes>,
    /// Weights of the nodes for the last functional.
    pub weights: Vec<Lanes>,
    /// The moment matrix as it was, where a lane needs it once more.
    dense: LeastSquares,
    row: Vec<f64>,
}

impl<const M: usize> MomentFit<M> {
    /// Takes the supports as they stand: moments Σ W p pᵀ and their factorization. Returns the least share of a pivot in its
    /// diagonal, lane by lane.
    pub fn factorize(&mut self, basis: &Basis<M>) -> [f64; LANES] {
        let number = basis.size();
        let most = self.near.iter().map(Vec::len).max().unwrap_or(0);
        self.systems.reset(number);
        self.systems.matrix_mut().fill(Lanes::splat(0.0));
        self.values.resize(most * number, Lanes::splat(0.0));
        self.windows.clear();
        for k in 0..most {
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
        self.systems.factorize().to_array()
    }

    /// The fit of the heights of the nodes: its coefficients are left in `solution`.
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

    /// Solves for the functional that stands in `solution` and makes the weights W_j z·p(x_j) of all nodes.
    pub fn solve(&mut self) {
        self.systems.solve(&mut self.solution);
        self.weigh();
    }

    fn weigh(&mut self) {
        let number = self.solution.len();
        self.weights.clear();
        for (values, window) in self.values.chunks_exact(number).zip(&self.windows) {
            let products = values.iter().zip(&self.solution);
            let value = products.fold(Lanes::splat(0.0), |sum, (p, z)| p.mul_add(*z, sum));
            self.weights.push(*window * value);
        }
    }

    /// The same for one lane whose moments are of low rank, by a rank-revealing solution, for a functional given by its values on
    /// the functions. The weights of that lane stand in `weights` of lane `lane` afterwards. Returns the largest moment condition
    /// that stays open, by the largest of the functional.
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
        let open = (0..number).map(|a| (moment(a) - functional[a]).abs()).fold(0.0, f64::max);
        open / functional.iter().fold(f64::MIN_POSITIVE, |most, f| most.max(f.abs()))
    }
}
