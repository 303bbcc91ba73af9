//! Conjugate gradients for symmetric matrices (Hestenes and Stiefel 1952), also for semi-definite ones whose null space are
//! the constants of each part.

use super::{Convergence, IncompleteFactors, LinearMap, Stopping, add, dot, norm};
use crate::linear_algebra::SparseRows;
use crate::linear_algebra::mean_term::MeanTerm;

/// A symmetric preconditioner.
#[derive(Debug)]
pub enum SymmetricFactors {
    /// Incomplete Cholesky factors: of a symmetric matrix ILU(0) is L D Lᵀ in its pattern.
    Incomplete(IncompleteFactors),
    /// The inverse of the diagonal (Jacobi), where an incomplete pivot is not positive.
    Diagonal(Vec<f64>),
}

impl SymmetricFactors {
    /// The preconditioner of a symmetric matrix with a positive diagonal whose rows are sorted.
    #[must_use]
    pub fn from_rows(rows: &SparseRows) -> Self {
        match IncompleteFactors::from_rows(rows) {
            Ok(factors) if factors.has_positive_pivots() => Self::Incomplete(factors),
            _ => {
                let diagonal = |i: usize| {
                    let (columns, weights) = rows.row(i);
                    let own = columns.iter().zip(weights).find(|(j, _)| **j as usize == i);
                    own.map_or(1.0, |(_, w)| if *w > 0.0 { 1.0 / w } else { 1.0 })
                };
                Self::Diagonal((0..rows.rows()).map(diagonal).collect())
            }
        }
    }

    fn solve(&self, b: &[f64], x: &mut [f64]) {
        match self {
            Self::Incomplete(factors) => factors.solve(b, x),
            Self::Diagonal(inverse) => {
                x.iter_mut().zip(b).zip(inverse).for_each(|((x, b), inverse)| *x = b * inverse);
            }
        }
    }
}

/// Vectors of the recurrence, reused from one solution to the next.
#[derive(Debug, Default)]
pub struct Workspace {
    vectors: [Vec<f64>; 5],
}

/// Improves `x` until it solves A x = b with a symmetric matrix.
///
/// With `null_space`, the matrix maps the constants of each part to zero. The sum of b over each part must then vanish, and
/// constants that rounding brings in are taken out again; the equal weights of the term count, not its factors.
pub fn solve(
    map: &dyn LinearMap,
    factors: &SymmetricFactors,
    null_space: Option<&MeanTerm>,
    b: &[f64],
    x: &mut [f64],
    stopping: Stopping,
    workspace: &mut Workspace,
) -> Convergence {
    let n = b.len();
    workspace.vectors.iter_mut().for_each(|vector| vector.resize(n, 0.0));
    let [r, z, p, product, scratch] = &mut workspace.vectors;
    let project = |vector: &mut [f64]| {
        if let Some(term) = null_space {
            term.subtract_means(vector);
        }
    };
    let goal = stopping.tolerance * norm(b);
    let mut iterations = 0;
    let mut last = f64::INFINITY;
    while iterations < stopping.max_iterations && !map.is_interrupted() {
        map.apply(x, r);
        r.iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
        project(r);
        // This also holds for b = 0.
        if norm(r) <= goal {
            break;
        }
        p.fill(0.0);
        let mut rho = 0.0;
        let (mut progress, before) = (super::Progress::new(norm(r)), iterations);
        while iterations < stopping.max_iterations && !map.is_interrupted() {
            iterations += 1;
            factors.solve(r, z);
            project(z);
            let next = dot(r, z);
            let beta = if rho == 0.0 { 0.0 } else { next / rho };
            rho = next;
            p.iter_mut().zip(z.iter()).for_each(|(p, z)| *p = z + beta * *p);
            map.apply(p, product);
            let curvature = dot(p, product);
            if !(curvature > 0.0 && rho > 0.0) {
                break;
            }
            let alpha = rho / curvature;
            add(x, alpha, p);
            add(r, -alpha, product);
            let size = norm(r);
            if size <= goal || progress.has_stalled(size, iterations - before) {
                break;
            }
        }
        let found = Convergence::from_solution(map, b, x, iterations, scratch);
        if found.is_final(stopping, &mut last) {
            return found;
        }
    }
    Convergence::from_solution(map, b, x, iterations, scratch)
}

#[cfg(test)]
mod tests {
    use super::{MeanTerm, SparseRows, Stopping, SymmetricFactors, Workspace, solve};

    /// Two rings without exchange: −Σ ℓ (x_j − x_i).
    fn rings(n: usize) -> SparseRows {
        let mut rows = SparseRows::default();
        for i in 0..2 * n {
            let base = i / n * n;
            let near = [base + (i + n - 1) % n, base + (i + 1) % n];
            rows.push_row(&[near[0] as u32, i as u32, near[1] as u32], &[-1.0, 2.0, -1.0]);
        }
        rows.sorted()
    }

    #[test]
    fn a_singular_system_of_two_parts_is_solved_without_constants() {
        let n = 64;
        let rows = rings(n);
        let parts = (0..2 * n).map(|i| (i / n) as u32).collect();
        let term = MeanTerm::new(parts, vec![1.0; 2 * n], vec![1.0; 2]);
        let mut exact: Vec<f64> =
            (0..2 * n).map(|i| (std::f64::consts::TAU * i as f64 / n as f64).sin() + (i as f64 * 0.7).cos()).collect();
        term.subtract_means(&mut exact);
        let mut b = vec![0.0; 2 * n];
        rows.apply(&exact, &mut b);
        let stopping = Stopping { tolerance: 1e-12, max_iterations: 500 };
        let diagonal = SymmetricFactors::Diagonal(vec![0.5; 2 * n]);
        for factors in [SymmetricFactors::from_rows(&rows), diagonal] {
            let mut x = vec![0.0; 2 * n];
            let found = solve(&rows, &factors, Some(&term), &b, &mut x, stopping, &mut Workspace::default());
            assert!(found.is_within(stopping) && found.iterations < 200, "{found:?}");
            assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-9));
        }
    }

    #[test]
    fn a_matrix_that_is_not_definite_ends_without_a_success() {
        let mut rows = SparseRows::default();
        rows.push_row(&[0, 1], &[1.0, 3.0]);
        rows.push_row(&[0, 1], &[3.0, 1.0]);
        let factors = SymmetricFactors::from_rows(&rows);
        assert!(matches!(factors, SymmetricFactors::Diagonal(_)));
        let stopping = Stopping { tolerance: 1e-12, max_iterations: 100 };
        let mut x = [0.0; 2];
        let found = solve(&rows, &factors, None, &[1.0, -1.0], &mut x, stopping, &mut Workspace::default());
        assert!(!found.is_within(stopping) && found.iterations < 10, "{found:?}");
    }
}
