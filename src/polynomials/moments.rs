//! Regressions by moments, one in each vector lane.
//!
//! The entries of the Gram matrix of the weighted monomials are moments, G_αβ = Σ_j w_j t_j^(α+β). For degree 4 these
//! are 45 sums instead of 120 in the plane, and 165 instead of 630 in space. From [`REFINEMENT_MIN_DEGREE`] on, one
//! step of iterative refinement with the residuals of the data restores the digits that squaring the condition number
//! costs.

use super::MAX_DEGREE;
use super::horner::nested_indices;
use super::multi_index::term_count;
use crate::linear_algebra::normal_equations::{LaneSystems, packed_row};
use crate::linear_algebra::number::{LANES, Lanes};

/// Smallest degree whose solutions are refined.
pub const REFINEMENT_MIN_DEGREE: usize = 5;

/// Number of neighbors that one pass adds to the sums, so that each sum is loaded and stored once for all of them.
const NEIGHBORS_PER_PASS: usize = 4;

/// Powers t⁰ … t^(2n) of the last coordinate, for the neighbors of one pass.
type Powers = [[Lanes; NEIGHBORS_PER_PASS]; 2 * MAX_DEGREE + 1];

/// Solver for regressions of one total degree.
#[derive(Debug, Clone)]
pub struct Moments<const D: usize> {
    degree: usize,
    /// Index of the moment that each entry of the packed Gram matrix equals.
    gram: Vec<u16>,
}

/// Data of a batch of regressions, one per lane, with the workspace of their solution.
#[derive(Debug, Clone)]
pub struct LaneBatch<const D: usize> {
    /// Number of neighbors per lane. Lanes with fewer are padded with rows of weight 0.
    rows: usize,
    /// Local coordinates of the neighbors.
    coordinates: [Vec<[f64; LANES]>; D],
    /// Weights of the neighbors.
    weights: Vec<[f64; LANES]>,
    /// Values of the neighbors, quantity by quantity.
    values: Vec<[f64; LANES]>,
    moments: Vec<Lanes>,
    systems: LaneSystems,
    solution: Vec<Lanes>,
    correction: Vec<Lanes>,
    residuals: Vec<Lanes>,
    powers: Powers,
}

impl<const D: usize> Default for LaneBatch<D> {
    fn default() -> Self {
        Self {
            rows: 0,
            coordinates: std::array::from_fn(|_| Vec::new()),
            weights: Vec::new(),
            values: Vec::new(),
            moments: Vec::new(),
            systems: LaneSystems::default(),
            solution: Vec::new(),
            correction: Vec::new(),
            residuals: Vec::new(),
            powers: [[Lanes::splat(1.0); NEIGHBORS_PER_PASS]; 2 * MAX_DEGREE + 1],
        }
    }
}

impl<const D: usize> LaneBatch<D> {
    /// Starts a batch with up to `rows` neighbors per lane and the given number of quantities.
    pub fn reset(&mut self, rows: usize, quantities: usize) {
        let rows = rows.next_multiple_of(NEIGHBORS_PER_PASS);
        self.rows = rows;
        let clear = |numbers: &mut Vec<[f64; LANES]>, length: usize| {
            numbers.clear();
            numbers.resize(length, [0.0; LANES]);
        };
        for axis in &mut self.coordinates {
            clear(axis, rows);
        }
        clear(&mut self.weights, rows);
        clear(&mut self.values, rows * quantities);
    }

    /// Writes the local coordinates `t` and the weight of a neighbor. Its values are written by [`Self::set_value`].
    #[inline(always)]
    pub fn set_row(&mut self, lane: usize, row: usize, t: &[f64; D], weight: f64) {
        for (axis, t) in self.coordinates.iter_mut().zip(t) {
            axis[row][lane] = *t;
        }
        self.weights[row][lane] = weight;
    }

    /// Writes the value of a quantity at a neighbor.
    #[inline(always)]
    pub fn set_value(&mut self, lane: usize, row: usize, quantity: usize, value: f64) {
        self.values[quantity * self.rows + row][lane] = value;
    }

    /// Multiplies every weight by exp(−k ‖t‖²).
    pub fn apply_weights(&mut self, k: f64) {
        if k == 0.0 {
            return;
        }
        for (row, weight) in self.weights.iter_mut().enumerate() {
            let mut r2 = Lanes::splat(0.0);
            for axis in &self.coordinates {
                let t = Lanes::new(axis[row]);
                r2 = t.mul_add(t, r2);
            }
            *weight = (Lanes::new(*weight) * (r2 * Lanes::splat(-k)).exp()).to_array();
        }
    }
}

impl<const D: usize> Moments<D> {
    /// The solver for polynomials of a total degree.
    #[must_use]
    pub fn new(degree: usize) -> Self {
        let (terms, moments) = (nested_indices::<D>(degree), nested_indices::<D>(2 * degree));
        let mut gram = Vec::with_capacity(packed_row(terms.len()));
        for (i, alpha) in terms.iter().enumerate() {
            for beta in &terms[..=i] {
                let sum: [u8; D] = std::array::from_fn(|d| alpha[d] + beta[d]);
                gram.extend(moments.iter().position(|index| *index == sum).map(|place| place as u16));
            }
        }
        Self { degree, gram }
    }

    /// Fits all quantities of a batch.
    ///
    /// Returns the smallest pivot ratio of each lane, and the coefficients, quantity by quantity, in nested order.
    pub fn solve<'b>(&self, batch: &'b mut LaneBatch<D>, quantities: usize) -> (Lanes, &'b [Lanes]) {
        match self.degree {
            1 => self.solve_unrolled::<1>(batch, quantities),
            2 => self.solve_unrolled::<2>(batch, quantities),
            3 => self.solve_unrolled::<3>(batch, quantities),
            4 => self.solve_unrolled::<4>(batch, quantities),
            5 => self.solve_unrolled::<5>(batch, quantities),
            6 => self.solve_unrolled::<6>(batch, quantities),
            7 => self.solve_unrolled::<7>(batch, quantities),
            _ => self.solve_unrolled::<MAX_DEGREE>(batch, quantities),
        }
    }

    /// [`Self::solve`] for a degree N that is known to the compiler.
    fn solve_unrolled<'b, const N: usize>(
        &self,
        batch: &'b mut LaneBatch<D>,
        quantities: usize,
    ) -> (Lanes, &'b [Lanes]) {
        let zero = Lanes::splat(0.0);
        let terms = term_count::<D>(N);
        let LaneBatch { rows, coordinates, weights, values, moments, systems, solution, correction, residuals, powers } =
            batch;
        let rows = *rows;
        moments.clear();
        moments.resize(term_count::<D>(2 * N), zero);
        for first in (0..rows).step_by(NEIGHBORS_PER_PASS) {
            let mut scale = [zero; NEIGHBORS_PER_PASS];
            for q in 0..NEIGHBORS_PER_PASS {
                scale[q] = Lanes::new(weights[first + q]);
            }
            add_monomials::<D, N, true>(coordinates, first, &scale, powers, moments);
        }
        systems.reset(terms);
        for (entry, place) in systems.matrix_mut().iter_mut().zip(&self.gram) {
            *entry = moments[*place as usize];
        }
        let least = systems.factorize();
        solution.clear();
        solution.resize(quantities * terms, zero);
        for (quantity, coefficients) in solution.chunks_exact_mut(terms).enumerate() {
            let values = &values[quantity * rows..(quantity + 1) * rows];
            for first in (0..rows).step_by(NEIGHBORS_PER_PASS) {
                let mut scale = [zero; NEIGHBORS_PER_PASS];
                for q in 0..NEIGHBORS_PER_PASS {
                    scale[q] = Lanes::new(weights[first + q]) * Lanes::new(values[first + q]);
                }
                add_monomials::<D, N, false>(coordinates, first, &scale, powers, coefficients);
            }
            systems.solve(coefficients);
            if N >= REFINEMENT_MIN_DEGREE {
                residuals.clear();
                residuals.extend((0..rows).map(|row| {
                    let mut t = [zero; D];
                    for d in 0..D {
                        t[d] = Lanes::new(coordinates[d][row]);
                    }
                    Lanes::new(weights[row]) * (Lanes::new(values[row]) - value::<D, N>(coefficients, &t))
                }));
                correction.clear();
                correction.resize(terms, zero);
                for first in (0..rows).step_by(NEIGHBORS_PER_PASS) {
                    let mut scale = [zero; NEIGHBORS_PER_PASS];
                    scale.copy_from_slice(&residuals[first..first + NEIGHBORS_PER_PASS]);
                    add_monomials::<D, N, false>(coordinates, first, &scale, powers, correction);
                }
                systems.solve(correction);
                for (c, change) in coefficients.iter_mut().zip(correction.iter()) {
                    *c += *change;
                }
            }
        }
        (least, solution)
    }
}

/// Adds Σ_q scale_q t_q^α over the neighbors of one pass to the sums for all |α| ≤ N (|α| ≤ 2 N with `DOUBLE`), in
/// nested order.
#[inline(always)]
fn add_monomials<const D: usize, const N: usize, const DOUBLE: bool>(
    coordinates: &[Vec<[f64; LANES]>; D],
    first: usize,
    scale: &[Lanes; NEIGHBORS_PER_PASS],
    powers: &mut Powers,
    sums: &mut [Lanes],
) {
    let degree = if DOUBLE { 2 * N } else { N };
    let load = |d: usize, q: usize| Lanes::new(coordinates[d][first + q]);
    let mut x = *scale;
    let (mut y, mut z) = ([Lanes::splat(0.0); NEIGHBORS_PER_PASS], [Lanes::splat(0.0); NEIGHBORS_PER_PASS]);
    for q in 0..NEIGHBORS_PER_PASS {
        (y[q], z[q]) = (load(D - 2, q), load(D - 1, q));
        powers[0][q] = Lanes::splat(1.0);
    }
    for k in 1..=degree {
        for q in 0..NEIGHBORS_PER_PASS {
            powers[k][q] = powers[k - 1][q] * z[q];
        }
    }
    let outer = if D == 3 { degree } else { 0 };
    let mut place = 0;
    for i in 0..=outer {
        let mut a = x;
        for j in 0..=degree - i {
            let row = &mut sums[place..=place + degree - i - j];
            place += row.len();
            for (sum, power) in row.iter_mut().zip(powers.iter()) {
                let mut s = *sum;
                for q in 0..NEIGHBORS_PER_PASS {
                    s = a[q].mul_add(power[q], s);
                }
                *sum = s;
            }
            for q in 0..NEIGHBORS_PER_PASS {
                a[q] *= y[q];
            }
        }
        if D == 3 {
            for (q, x) in x.iter_mut().enumerate() {
                *x *= load(0, q);
            }
        }
    }
}

/// Value p(t) of the polynomial with the given coefficients in nested order.
#[inline(always)]
fn value<const D: usize, const N: usize>(coefficients: &[Lanes], t: &[Lanes; D]) -> Lanes {
    let zero = Lanes::splat(0.0);
    let mut place = coefficients.len();
    let mut v = zero;
    let outer = if D == 3 { N } else { 0 };
    for i in (0..=outer).rev() {
        let mut w = zero;
        for j in (0..=N - i).rev() {
            let mut s = zero;
            for _ in 0..=N - i - j {
                place -= 1;
                s = s.mul_add(t[D - 1], coefficients[place]);
            }
            w = w.mul_add(t[D - 2], s);
        }
        v = if D == 3 { v.mul_add(t[0], w) } else { w };
    }
    v
}
