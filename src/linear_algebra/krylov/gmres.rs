//! GMRES, begun anew every m steps, with right preconditioning (Saad, Schultz, SIAM J. Sci. Stat. Comput. 7, 1986).

use super::{Convergence, IncompleteFactors, LinearMap, Stopping, add, dot, norm};

/// Vectors of a solution, to be used again.
#[derive(Debug, Default)]
pub struct Workspace {
    basis: Vec<Vec<f64>>,
    /// Columns of the triangle that rotations make of the Hessenberg matrix.
    triangle: Vec<Vec<f64>>,
    rotations: Vec<(f64, f64)>,
    right: Vec<f64>,
    hat: Vec<f64>,
    scratch: Vec<f64>,
}

/// Goes on from `x` to the solution of A x = b, `restart` vectors at a time.
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
    let Workspace { basis, triangle, rotations, right, hat, scratch } = workspace;
    basis.resize_with(restart + 1, Vec::new);
    // The others when they are needed: most solutions take fewer vectors than they may.
    basis[0].resize(n, 0.0);
    hat.resize(n, 0.0);
    scratch.resize(n, 0.0);
    let goal = stopping.tolerance * norm(b);
    let mut iterations = 0;
    let (mut is_done, mut last) = (false, f64::INFINITY);
    loop {
        if is_done {
            let found = Convergence::from_solution(map, b, x, iterations, scratch);
            if found.is_final(stopping, &mut last) {
                return found;
            }
        }
        let first = &mut basis[0];
        map.apply(x, first);
        first.iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
        let beta = norm(first);
        if beta <= goal || !beta.is_finite() || iterations >= stopping.max_iterations || map.is_interrupted() {
            break;
        }
        first.iter_mut().for_each(|r| *r /= beta);
        triangle.clear();
        rotations.clear();
        right.clear();
        right.push(beta);
        for k in 0..restart {
            iterations += 1;
            factors.solve(&basis[k], hat);
            let (known, next) = basis.split_at_mut(k + 1);
            let w = &mut next[0];
            w.resize(n, 0.0);
            map.apply(hat, w);
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
            for (j, (c, s)) in rotations.iter().enumerate() {
                (column[j], column[j + 1]) = (c * column[j] + s * column[j + 1], c * column[j + 1] - s * column[j]);
            }
            let length = column[k].hypot(below);
            let (c, s) = if length > 0.0 { (column[k] / length, below / length) } else { (1.0, 0.0) };
            column[k] = length;
            rotations.push((c, s));
            triangle.push(column);
            let rest = right[k];
            right[k] = c * rest;
            right.push(-s * rest);
            let is_over = iterations >= stopping.max_iterations || map.is_interrupted();
            is_done = right[k + 1].abs() <= goal || below == 0.0;
            if is_done || is_over {
                break;
            }
        }
        // The combination of the basis, from the last to the first.
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
    Convergence::from_solution(map, b, x, iterations, scratch)
}
