//! BiCGSTAB with right preconditioning (van der Vorst, SIAM J. Sci. Stat. Comput. 13, 1992).

use super::{Convergence, IncompleteFactors, LinearMap, Stopping, add, dot, norm};

/// Vectors of a solution, to be used again.
#[derive(Debug, Default)]
pub struct Storage {
    vectors: [Vec<f64>; 8],
}

/// Goes on from `x` to the solution of A x = b. A breakdown (a scalar that vanishes) begins anew from where it is.
pub fn solve(
    map: &dyn LinearMap,
    factors: &IncompleteFactors,
    b: &[f64],
    x: &mut [f64],
    stopping: Stopping,
    storage: &mut Storage,
) -> Convergence {
    let n = b.len();
    storage.vectors.iter_mut().for_each(|vector| vector.resize(n, 0.0));
    let [r, shadow, p, v, s, t, hat, room] = &mut storage.vectors;
    let goal = stopping.tolerance * norm(b);
    let mut iterations = 0;
    'begin: while iterations < stopping.most_iterations && !map.is_given_up() {
        map.apply(x, r);
        r.iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
        // Also where b is nothing.
        if norm(r) <= goal {
            break;
        }
        shadow.copy_from_slice(r);
        p.copy_from_slice(r);
        let mut rho = dot(shadow, r);
        while iterations < stopping.most_iterations && !map.is_given_up() {
            iterations += 1;
            factors.solve(p, hat);
            map.apply(hat, v);
            let across = dot(shadow, v);
            if across.is_nan() || across.abs() <= f64::MIN_POSITIVE {
                continue 'begin;
            }
            let alpha = rho / across;
            add(x, alpha, hat);
            s.copy_from_slice(r);
            add(s, -alpha, v);
            if norm(s) <= goal {
                break 'begin;
            }
            factors.solve(s, hat);
            map.apply(hat, t);
            let size = dot(t, t);
            let omega = if size > 0.0 { dot(t, s) / size } else { 0.0 };
            add(x, omega, hat);
            r.copy_from_slice(s);
            add(r, -omega, t);
            if norm(r) <= goal {
                break 'begin;
            }
            let next = dot(shadow, r);
            let beta = next / rho * (alpha / omega);
            if !(beta.is_finite() && next.abs() > f64::MIN_POSITIVE) {
                continue 'begin;
            }
            rho = next;
            for ((p, v), r) in p.iter_mut().zip(v.iter()).zip(r.iter()) {
                *p = r + beta * (*p - omega * v);
            }
        }
    }
    Convergence::of(map, b, x, iterations, room)
}
