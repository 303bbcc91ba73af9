//! Iterative solution of large sparse systems A x = b with an incomplete factorization as preconditioner, one file per
//! method.
//!
//! The methods judge themselves by the true residual. They start again from it when the residual of their recurrence
//! was too optimistic.
//!
//! ```
//! use meniscus::linear_algebra::SparseRows;
//! use meniscus::linear_algebra::krylov::{IncompleteFactors, Stopping, gmres};
//!
//! let mut a = SparseRows::default();
//! a.push_row(&[0, 1], &[4.0, 1.0]);
//! a.push_row(&[0, 1], &[1.0, 3.0]);
//! let factors = IncompleteFactors::from_rows(&a).unwrap();
//! let (b, mut x) = ([1.0, 2.0], [0.0; 2]);
//! let stopping = Stopping { tolerance: 1e-12, max_iterations: 10 };
//! let found = gmres::solve(&a, &factors, &b, &mut x, 10, stopping, &mut gmres::Workspace::default());
//! assert!(found.is_within(stopping) && (x[0] - 1.0 / 11.0).abs() < 1e-12);
//! ```

pub mod bicgstab;
pub mod conjugate_gradients;
pub mod gmres;
pub mod incomplete_factors;
pub mod least_modes;
pub mod ritz;

pub use incomplete_factors::IncompleteFactors;

use super::SparseRows;
use super::least_squares::dot;
use super::mean_term::MeanTerm;
use crate::parallel::Interrupt;

/// A square matrix A, known by its products with vectors.
pub trait LinearMap: Sync {
    /// Number of unknowns.
    fn size(&self) -> usize;
    /// Writes A x to `out`.
    fn apply(&self, x: &[f64], out: &mut [f64]);
    /// The norm ‖A‖∞, or an upper bound of it.
    fn infinity_norm(&self) -> f64;
    /// Whether the solution shall be abandoned.
    fn is_interrupted(&self) -> bool {
        false
    }
}

/// A linear map whose solution an [`Interrupt`] abandons.
pub struct Interruptible<'a> {
    /// The matrix A.
    pub map: &'a dyn LinearMap,
    /// The flag that abandons the solution.
    pub interrupt: &'a Interrupt,
}

impl LinearMap for Interruptible<'_> {
    fn size(&self) -> usize {
        self.map.size()
    }

    fn apply(&self, x: &[f64], out: &mut [f64]) {
        self.map.apply(x, out);
    }

    fn infinity_norm(&self) -> f64 {
        self.map.infinity_norm()
    }

    fn is_interrupted(&self) -> bool {
        self.interrupt.is_raised()
    }
}

impl LinearMap for SparseRows {
    fn size(&self) -> usize {
        self.rows()
    }

    fn apply(&self, x: &[f64], out: &mut [f64]) {
        Self::apply(self, x, out);
    }

    fn infinity_norm(&self) -> f64 {
        Self::infinity_norm(self)
    }
}

/// The map A + Σ_p α_p 1_p w_pᵀ, which makes an operator A regular that maps the constants of each part to zero.
///
/// Its solutions have no mean if the right-hand side has none.
#[derive(Debug)]
pub struct WithMeans<'a> {
    /// The matrix A.
    pub rows: &'a SparseRows,
    /// The term of the means.
    pub term: &'a MeanTerm,
}

impl LinearMap for WithMeans<'_> {
    fn size(&self) -> usize {
        self.rows.rows()
    }

    fn apply(&self, x: &[f64], out: &mut [f64]) {
        self.rows.apply(x, out);
        self.term.add_to(x, out);
    }

    fn infinity_norm(&self) -> f64 {
        self.rows.infinity_norm() + self.term.alpha().iter().fold(0.0_f64, |most, alpha| most.max(alpha.abs()))
    }
}

/// Criterion for ending an iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stopping {
    /// Relative residual ‖b − A x‖/‖b‖ to reach.
    pub tolerance: f64,
    /// Largest number of iterations. One iteration applies the map once (GMRES) or twice (BiCGSTAB).
    pub max_iterations: u64,
}

/// Iterations and residual of a solution.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Convergence {
    /// Number of iterations.
    pub iterations: u64,
    /// Relative residual ‖b − A x‖/‖b‖ at the end, computed from x.
    pub residual: f64,
    /// Relative residual that the rounding of x and of A x leaves, whatever the solver.
    pub floor: f64,
}

/// Residuals up to this multiple of ε ‖A‖∞ ‖x‖/‖b‖ count as rounding.
///
/// Measured: direct and iterative solutions on lines and circles of 20,000 and 30,000 points end at 0.2 to 0.6 of that.
/// A solution that only the recurrence took for converged was at 1,000.
const ROUNDING: f64 = 4.0;
/// Largest floor that counts. Values of 1e136 beside a right-hand side of 1 once had a floor of 1e123.
const LARGEST_FLOOR: f64 = 1e-6;
/// A restart stagnates when it leaves more than this share of the true residual of the restart before.
const STAGNATION: f64 = 0.5;

/// Iterations without a new least residual after which a solution has stalled. Residuals of sound systems rise and fall over
/// some tens of iterations.
const PATIENCE: u64 = 300;
/// A residual counts as a new least one below this share of the one before.
const BETTER: f64 = 0.9;

/// The least residual of a recurrence so far, to notice when it does not become smaller any more.
#[derive(Debug)]
struct Progress {
    least: f64,
    waited: u64,
    /// Number of iterations at the last look.
    iterations: u64,
}

impl Progress {
    fn new(residual: f64) -> Self {
        Self { least: residual, waited: 0, iterations: 0 }
    }

    /// Takes the residual after so many iterations in all; true after many of them without progress.
    fn has_stalled(&mut self, residual: f64, iterations: u64) -> bool {
        self.waited += iterations - self.iterations;
        self.iterations = iterations;
        if residual < BETTER * self.least {
            (self.least, self.waited) = (residual, 0);
        }
        self.waited >= PATIENCE
    }
}

impl Convergence {
    /// Whether the tolerance is met.
    ///
    /// A factor of ten allows for the difference between the residual of the recurrence and the true one. The floor
    /// allows for the rounding of A x, below which no solver gets.
    #[must_use]
    pub fn is_within(&self, stopping: Stopping) -> bool {
        self.residual <= self.bound(stopping)
    }

    /// The residual at most for which it counts.
    #[must_use]
    pub fn bound(&self, stopping: Stopping) -> f64 {
        // The floor of a solution that blew up is no excuse for its residual.
        let floor = if self.floor <= LARGEST_FLOOR { self.floor } else { 0.0 };
        10.0 * stopping.tolerance + floor
    }

    /// Whether the solution is good enough, or another restart from the true residual would not improve it.
    ///
    /// `last` is the residual of the restart before; it is replaced by the present one.
    fn is_final(&self, stopping: Stopping, last: &mut f64) -> bool {
        let is_better = self.residual <= STAGNATION * std::mem::replace(last, self.residual);
        self.is_within(stopping) || !is_better
    }

    /// Computes the true residual of a solution `x`. `scratch` is a buffer for one vector.
    #[must_use]
    pub fn from_solution(map: &dyn LinearMap, b: &[f64], x: &[f64], iterations: u64, scratch: &mut Vec<f64>) -> Self {
        scratch.resize(b.len(), 0.0);
        map.apply(x, scratch);
        scratch.iter_mut().zip(b).for_each(|(a, b)| *a = b - *a);
        let inverse_norm = match norm(b) {
            size if size > 0.0 => 1.0 / size,
            _ => 1.0,
        };
        let floor = ROUNDING * f64::EPSILON * map.infinity_norm() * norm(x) * inverse_norm;
        Self { iterations, residual: norm(scratch) * inverse_norm, floor }
    }
}

/// Euclidean norm.
fn norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

/// Adds a x to y.
fn add(y: &mut [f64], a: f64, x: &[f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += a * x);
}

#[cfg(test)]
mod tests {
    use super::{
        IncompleteFactors, Interrupt, Interruptible, LinearMap, MeanTerm, SparseRows, Stopping, WithMeans, bicgstab,
        gmres,
    };

    /// Advection and diffusion on a ring or a line, a matrix that is not symmetric.
    fn operator(n: usize, is_ring: bool) -> SparseRows {
        let mut rows = SparseRows::default();
        for i in 0..n {
            let mut columns = Vec::new();
            let mut weights = Vec::new();
            for (j, w) in [((i + n - 1) % n, 1.3), (i, -2.1 + if is_ring { 0.1 } else { 0.0 }), ((i + 1) % n, 0.7)] {
                if is_ring || j.abs_diff(i) <= 1 {
                    columns.push(j as u32);
                    weights.push(w);
                }
            }
            rows.push_row(&columns, &weights);
        }
        rows.sorted()
    }

    const STOPPING: Stopping = Stopping { tolerance: 1e-11, max_iterations: 2000 };

    #[test]
    fn both_methods_solve_unsymmetric_systems() {
        let a = operator(300, false);
        let exact: Vec<f64> = (0..300).map(|i| f64::from(i).sin()).collect();
        let mut b = vec![0.0; 300];
        a.apply(&exact, &mut b);
        // The incomplete factorization of a tridiagonal matrix is complete. That of the ring is not.
        let factors = IncompleteFactors::from_rows(&operator(300, true).sorted()).unwrap();
        let mut x = vec![0.0; 300];
        let found = bicgstab::solve(&a, &factors, &b, &mut x, STOPPING, &mut bicgstab::Workspace::default());
        assert!(found.residual < 1e-10, "{found:?}");
        assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-6));
        let mut x = vec![0.0; 300];
        let found = gmres::solve(&a, &factors, &b, &mut x, 40, STOPPING, &mut gmres::Workspace::default());
        assert!(found.residual < 1e-10 && found.iterations > 0, "{found:?}");
        assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-6));
    }

    #[test]
    fn a_singular_operator_is_solved_without_mean() {
        let a = operator(200, true);
        let exact: Vec<f64> = (0..200).map(|i| (std::f64::consts::TAU * f64::from(i) / 200.0).sin()).collect();
        let mut b = vec![0.0; 200];
        a.apply(&exact, &mut b);
        let term = MeanTerm::uniform(200, 1.0);
        let map = WithMeans { rows: &a, term: &term };
        let factors = IncompleteFactors::from_rows(&a).unwrap();
        let mut x = vec![0.0; 200];
        let found = bicgstab::solve(&map, &factors, &b, &mut x, STOPPING, &mut bicgstab::Workspace::default());
        assert!(found.residual < 1e-10, "{found:?}");
        assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-7));
        assert_eq!(map.size(), 200);
    }

    /// Second differences on a line: the rounding of a solution leaves a residual far above the tolerance.
    #[test]
    fn residuals_of_rounding_count_as_converged() {
        let n = 20_000;
        let size = (n as f64).powi(2);
        let mut a = SparseRows::default();
        for i in 0..n {
            let columns: Vec<u32> = (i.max(1) - 1..(i + 2).min(n)).map(|j| j as u32).collect();
            let weights: Vec<f64> = columns.iter().map(|j| if *j as usize == i { -2.0 * size } else { size }).collect();
            a.push_row(&columns, &weights);
        }
        let b: Vec<f64> = (0..n).map(|i| (std::f64::consts::PI * i as f64 / n as f64).sin()).collect();
        let factors = IncompleteFactors::from_rows(&a).unwrap();
        for tolerance in [1e-10, 1e-14] {
            let stopping = Stopping { tolerance, max_iterations: 500 };
            let mut x = vec![0.0; n];
            let found = bicgstab::solve(&a, &factors, &b, &mut x, stopping, &mut bicgstab::Workspace::default());
            assert!(found.residual > 10.0 * tolerance && found.is_within(stopping), "{found:?}");
            assert!(found.iterations < 20, "{found:?}");
            let mut x = vec![0.0; n];
            let found = gmres::solve(&a, &factors, &b, &mut x, 40, stopping, &mut gmres::Workspace::default());
            assert!(found.residual > 10.0 * tolerance && found.is_within(stopping), "{found:?}");
            assert!(found.iterations < 20, "{found:?}");
        }
        // A wrong solution is not taken for rounding.
        let wrong = super::Convergence::from_solution(&a, &b, &vec![0.0; n], 0, &mut Vec::new());
        assert!(!wrong.is_within(STOPPING), "{wrong:?}");
    }

    /// Without a solution, a solver ends long before its last iteration.
    #[test]
    fn a_solution_that_stalls_ends_early() {
        let a = operator(200, true);
        let b: Vec<f64> = (0..200).map(|i| 1.0 + f64::from(i).sin()).collect();
        let factors = IncompleteFactors::from_rows(&a).unwrap();
        let stopping = Stopping { tolerance: 1e-10, max_iterations: 1_000_000 };
        let mut x = vec![0.0; 200];
        let found = bicgstab::solve(&a, &factors, &b, &mut x, stopping, &mut bicgstab::Workspace::default());
        assert!(!found.is_within(stopping) && found.iterations < 10_000, "{found:?}");
        let mut x = vec![0.0; 200];
        let found = gmres::solve(&a, &factors, &b, &mut x, 40, stopping, &mut gmres::Workspace::default());
        assert!(!found.is_within(stopping) && found.iterations < 10_000, "{found:?}");
    }

    #[test]
    fn an_interrupt_ends_a_solution() {
        let a = operator(300, true);
        let factors = IncompleteFactors::from_rows(&operator(300, false)).unwrap();
        let interrupt = Interrupt::default();
        interrupt.raise();
        let map = Interruptible { map: &a, interrupt: &interrupt };
        let b: Vec<f64> = (0..300).map(f64::from).collect();
        let never = Stopping { tolerance: 0.0, max_iterations: u64::MAX };
        let mut x = vec![0.0; 300];
        let found = bicgstab::solve(&map, &factors, &b, &mut x, never, &mut bicgstab::Workspace::default());
        assert_eq!(found.iterations, 0);
        let found = gmres::solve(&map, &factors, &b, &mut x, 40, never, &mut gmres::Workspace::default());
        assert_eq!(found.iterations, 0);
    }

    #[test]
    fn a_zero_right_hand_side_has_the_solution_zero() {
        let a = operator(10, false);
        let factors = IncompleteFactors::from_rows(&a).unwrap();
        let (b, mut x) = (vec![0.0; 10], vec![0.0; 10]);
        let found = bicgstab::solve(&a, &factors, &b, &mut x, STOPPING, &mut bicgstab::Workspace::default());
        assert_eq!((found.residual, x), (0.0, vec![0.0; 10]));
    }
}
