//! Restarted GMRES with right preconditioning (Saad 1986).

use super::{Convergence, IncompleteFactors, LinearMap, Progress, Stopping, add, dot, norm};

/// Vectors and factors of a cycle, reused from one solution to the next.
#[derive(Debug, Default)]
pub struct Workspace {
    /// Orthonormal basis of the Krylov space, one vector per step.
    basis: Vec<Vec<f64>>,
    /// Columns of the triangular matrix that the rotations make of the Hessenberg matrix.
    triangle: Vec<Vec<f64>>,
    /// Cosine and sine of each rotation.
    rotations: Vec<(f64, f64)>,
    /// Right-hand side of the small least-squares problem, later its solution.
    right: Vec<f64>,
    /// A preconditioned vector.
    hat: Vec<f64>,
    scratch: Vec<f64>,
}

/// Improves `x` until it solves A x = b, the matrix A being `map` and its preconditioner `factors`.
///
/// A cycle builds up to `restart` vectors of the Krylov space of the true residual and minimizes the residual over
/// them. The next cycle starts from the new residual. A solution that stalls ends early.
pub fn solve(
    map: &dyn LinearMap,
    factors: &IncompleteFactors,
    b: &[f64],
    x: &mut [f64],
    restart: usize,
    stopping: Stopping,
    workspace: &mut Workspace,
) -> Convergence {
    let n = b.len();
    // Later vectors are sized when they are needed, since most solutions take few of them.
    workspace.basis.resize_with(restart + 1, Vec::new);
    workspace.basis[0].resize(n, 0.0);
    workspace.hat.resize(n, 0.0);
    workspace.scratch.resize(n, 0.0);
    let goal = stopping.tolerance * norm(b);
    let mut iterations = 0;
    let (mut is_done, mut last) = (false, f64::INFINITY);
    let mut progress = Progress::new(f64::INFINITY);
    loop {
        if is_done {
            let found = Convergence::from_solution(map, b, x, iterations, &mut workspace.scratch);
            if found.is_final(stopping, &mut last) {
                return found;
            }
        }
        let first = &mut workspace.basis[0];
        map.apply(x, first);
        first.iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
        let beta = norm(first);
        let is_over = iterations >= stopping.max_iterations || progress.has_stalled(beta, iterations);
        if beta <= goal || !beta.is_finite() || is_over || map.is_interrupted() {
            break;
        }
        first.iter_mut().for_each(|r| *r /= beta);
        workspace.triangle.clear();
        workspace.rotations.clear();
        workspace.right.clear();
        workspace.right.push(beta);
        for k in 0..restart {
            iterations += 1;
            let column = workspace.extend_basis(map, factors, k);
            let is_exhausted = workspace.rotate(column, k);
            is_done = workspace.right[k + 1].abs() <= goal || is_exhausted;
            if is_done || iterations >= stopping.max_iterations || map.is_interrupted() {
                break;
            }
        }
        workspace.add_minimizer(factors, x);
    }
    Convergence::from_solution(map, b, x, iterations, &mut workspace.scratch)
}

impl Workspace {
    /// Adds the basis vector k + 1 by Arnoldi's method and returns column k of the Hessenberg matrix, k + 2 entries.
    fn extend_basis(&mut self, map: &dyn LinearMap, factors: &IncompleteFactors, k: usize) -> Vec<f64> {
        factors.solve(&self.basis[k], &mut self.hat);
        let (known, next) = self.basis.split_at_mut(k + 1);
        let w = &mut next[0];
        w.resize(self.hat.len(), 0.0);
        map.apply(&self.hat, w);
        let mut column = Vec::with_capacity(k + 2);
        for v in known.iter() {
            let h = dot(v, w);
            add(w, -h, v);
            column.push(h);
        }
        let below = norm(w);
        if below > 0.0 {
            w.iter_mut().for_each(|w| *w /= below);
        }
        column.push(below);
        column
    }

    /// Makes column k of the Hessenberg matrix triangular by the earlier rotations and a new one.
    ///
    /// The entry k + 1 of the right-hand side is then the residual. Returns whether the Krylov space is exhausted.
    fn rotate(&mut self, mut column: Vec<f64>, k: usize) -> bool {
        let below = column.pop().unwrap_or(0.0);
        for (j, (c, s)) in self.rotations.iter().enumerate() {
            (column[j], column[j + 1]) = (c * column[j] + s * column[j + 1], c * column[j + 1] - s * column[j]);
        }
        let length = column[k].hypot(below);
        let (c, s) = if length > 0.0 { (column[k] / length, below / length) } else { (1.0, 0.0) };
        column[k] = length;
        self.rotations.push((c, s));
        self.triangle.push(column);
        let rest = self.right[k];
        self.right[k] = c * rest;
        self.right.push(-s * rest);
        below == 0.0
    }

    /// Adds the preconditioned combination of the basis vectors with the smallest residual to `x`.
    fn add_minimizer(&mut self, factors: &IncompleteFactors, x: &mut [f64]) {
        let Self { basis, triangle, right, hat, scratch, .. } = self;
        let steps = triangle.len();
        for k in (0..steps).rev() {
            let known: f64 = (k + 1..steps).map(|j| triangle[j][k] * right[j]).sum();
            let pivot = triangle[k][k];
            right[k] = if pivot.abs() > 0.0 { (right[k] - known) / pivot } else { 0.0 };
        }
        scratch.fill(0.0);
        for (v, y) in basis.iter().zip(&right[..steps]) {
            add(scratch, *y, v);
        }
        factors.solve(scratch, hat);
        add(x, 1.0, hat);
    }
}
