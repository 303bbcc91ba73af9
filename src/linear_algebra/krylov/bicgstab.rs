//! BiCGSTAB with right preconditioning (van der Vorst 1992).

use super::{Convergence, IncompleteFactors, LinearMap, Progress, Stopping, add, dot, norm};

/// Vectors of the recurrence, reused from one solution to the next.
#[derive(Debug, Default)]
pub struct Workspace {
    vectors: [Vec<f64>; 8],
}

/// Improves `x` until it solves A x = b, the matrix A being `map` and its preconditioner `factors`.
///
/// The recurrence starts again from the true residual after a breakdown (a scalar that vanishes). It also does so when
/// its own residual is small and the true one is not, as long as that helps. A solution that stalls ends early.
pub fn solve(
    map: &dyn LinearMap,
    factors: &IncompleteFactors,
    b: &[f64],
    x: &mut [f64],
    stopping: Stopping,
    workspace: &mut Workspace,
) -> Convergence {
    let n = b.len();
    workspace.vectors.iter_mut().for_each(|vector| vector.resize(n, 0.0));
    let [r, shadow, p, v, s, t, hat, scratch] = &mut workspace.vectors;
    let goal = stopping.tolerance * norm(b);
    let (mut iterations, mut last) = (0, f64::INFINITY);
    let mut progress = Progress::new(f64::INFINITY);
    while iterations < stopping.max_iterations && !map.is_interrupted() {
        map.apply(x, r);
        r.iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
        // This also holds for b = 0. Breakdowns one after another are no progress either.
        if norm(r) <= goal || progress.has_stalled(norm(r), iterations) {
            break;
        }
        shadow.copy_from_slice(r);
        p.copy_from_slice(r);
        let mut rho = dot(shadow, r);
        let mut is_done = false;
        while !is_done && iterations < stopping.max_iterations && !map.is_interrupted() {
            iterations += 1;
            factors.solve(p, hat);
            map.apply(hat, v);
            let shadow_v = dot(shadow, v);
            if shadow_v.is_nan() || shadow_v.abs() <= f64::MIN_POSITIVE {
                break;
            }
            let alpha = rho / shadow_v;
            add(x, alpha, hat);
            s.copy_from_slice(r);
            add(s, -alpha, v);
            if norm(s) <= goal {
                is_done = true;
                break;
            }
            factors.solve(s, hat);
            map.apply(hat, t);
            let t_t = dot(t, t);
            let omega = if t_t > 0.0 { dot(t, s) / t_t } else { 0.0 };
            add(x, omega, hat);
            r.copy_from_slice(s);
            add(r, -omega, t);
            is_done = norm(r) <= goal;
            let next = dot(shadow, r);
            let beta = next / rho * (alpha / omega);
            if progress.has_stalled(norm(r), iterations) || !(beta.is_finite() && next.abs() > f64::MIN_POSITIVE) {
                break;
            }
            rho = next;
            for ((p, v), r) in p.iter_mut().zip(v.iter()).zip(r.iter()) {
                *p = r + beta * (*p - omega * v);
            }
        }
        if is_done {
            let found = Convergence::from_solution(map, b, x, iterations, scratch);
            if found.is_final(stopping, &mut last) {
                return found;
            }
        }
    }
    Convergence::from_solution(map, b, x, iterations, scratch)
}
