//! Unisolvent nodes of total degree on a Chebyshev–Lobatto grid (PCP 3.1; Hecht 2020).
//!
//! The one-dimensional generating nodes are the Chebyshev–Lobatto points of `[−1, 1]` in Leja order; the nodes
//! q_α = (p_{α_1}, …, p_{α_D}), |α| ≤ n, determine every polynomial of total degree n. In Newton form
//! N_β(x) = ∏_i ∏_{j < β_i} (x_i − p_j) the matrix N_β(q_α) is triangular for graded indices.

use super::multi_index::MultiIndexSet;
use std::f64::consts::PI;

/// The Chebyshev–Lobatto points cos(kπ/n), k = 0…n, in Leja order.
///
/// Each point has the largest product of distances to the points before it. This order keeps Newton's form stable.
#[must_use]
pub fn leja_ordered_chebyshev_lobatto(degree: usize) -> Vec<f64> {
    if degree == 0 {
        return vec![0.0];
    }
    let mut rest: Vec<f64> = (0..=degree)
        .map(|k| {
            // In this form with a sine, the points are symmetric to the last bit.
            (PI * (degree as f64 - 2.0 * k as f64) / (2.0 * degree as f64)).sin()
        })
        .collect();
    let mut ordered = vec![rest.remove(0)];
    while !rest.is_empty() {
        let distance = |x: f64| ordered.iter().map(|p: &f64| (x - p).abs()).product::<f64>();
        let mut best = 0;
        for k in 1..rest.len() {
            if distance(rest[k]) > distance(rest[best]) * (1.0 + 1e-12) {
                best = k;
            }
        }
        ordered.push(rest.remove(best));
    }
    ordered
}

/// The matrix C with L_α = Σ_β C_{αβ} N_β, which gives the Lagrange polynomials of the unisolvent nodes in Newton form.
///
/// C is the inverse transpose of N_β(q_α) and upper triangular for graded indices. It is stored by rows, `terms ×
/// terms`.
#[must_use]
pub fn lagrange_in_newton_form<const D: usize>(set: &MultiIndexSet<D>, nodes: &[f64]) -> Vec<f64> {
    let indices = set.indices();
    let n = indices.len();
    // The matrix V[a][b] = N_b(q_a) is lower triangular.
    let mut values = vec![0.0; n * n];
    for (a, alpha) in indices.iter().enumerate() {
        for (b, beta) in indices.iter().enumerate() {
            values[a * n + b] = (0..D)
                .map(|d| (0..beta[d] as usize).map(|j| nodes[alpha[d] as usize] - nodes[j]).product::<f64>())
                .product();
        }
    }
    // L_α(q_γ) = δ_αγ means C Vᵀ = I. Row α of C is therefore V⁻¹ e_α, by forward substitution.
    let mut matrix = vec![0.0; n * n];
    for alpha in 0..n {
        for row in alpha..n {
            let mut sum = if row == alpha { 1.0 } else { 0.0 };
            for k in alpha..row {
                sum -= values[row * n + k] * matrix[alpha * n + k];
            }
            matrix[alpha * n + row] = sum / values[row * n + row];
        }
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::{MultiIndexSet, lagrange_in_newton_form, leja_ordered_chebyshev_lobatto};

    #[test]
    fn lagrange_polynomials_are_one_at_their_node_and_zero_at_the_others() {
        for degree in 1..=8 {
            let set = MultiIndexSet::<2>::total_degree(degree);
            let nodes = leja_ordered_chebyshev_lobatto(degree);
            let matrix = lagrange_in_newton_form(&set, &nodes);
            let n = set.indices().len();
            for (g, gamma) in set.indices().iter().enumerate() {
                for alpha in 0..n {
                    let value: f64 = set
                        .indices()
                        .iter()
                        .enumerate()
                        .map(|(b, beta)| {
                            matrix[alpha * n + b]
                                * (0..2)
                                    .map(|d| {
                                        let x = nodes[gamma[d] as usize];
                                        (0..beta[d] as usize).map(|j| x - nodes[j]).product::<f64>()
                                    })
                                    .product::<f64>()
                        })
                        .sum();
                    let expected = f64::from(u8::from(g == alpha));
                    assert!((value - expected).abs() < 1e-11, "degree {degree}: L_{alpha}(q_{g}) = {value}");
                }
            }
        }
    }
}
