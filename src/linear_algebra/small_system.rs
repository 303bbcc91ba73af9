//! Symmetric systems of the dimension of space, with pivots held above a floor.

use nalgebra::{SMatrix, SVector};

/// Solves `A x = b` for symmetric `A` by L D Lᵀ without exchanges, raising every pivot below `floor > 0` to it.
///
/// For positive definite `A` with pivots above the floor this is the exact solution; otherwise the result is still
/// a direction of descent for a quadratic model with gradient `−b`, which is what a safeguarded Newton step needs.
/// Returns the solution and whether a pivot had to be raised.
#[must_use]
pub fn solve_symmetric_floored<const D: usize>(
    matrix: &SMatrix<f64, D, D>,
    rhs: &SVector<f64, D>,
    floor: f64,
) -> (SVector<f64, D>, bool) {
    let mut lower = *matrix;
    let mut raised = false;
    for j in 0..D {
        for k in 0..j {
            let pivot = lower[(k, k)];
            let factor = lower[(j, k)] / pivot;
            for i in j..D {
                lower[(i, j)] -= factor * lower[(i, k)];
            }
        }
        if lower[(j, j)] < floor {
            lower[(j, j)] = floor;
            raised = true;
        }
    }
    let mut x = *rhs;
    for j in 0..D {
        for k in 0..j {
            x[j] -= lower[(j, k)] / lower[(k, k)] * x[k];
        }
    }
    for j in 0..D {
        x[j] /= lower[(j, j)];
    }
    for j in (0..D).rev() {
        for i in j + 1..D {
            x[j] -= lower[(i, j)] / lower[(j, j)] * x[i];
        }
    }
    (x, raised)
}

#[cfg(test)]
mod tests {
    use super::solve_symmetric_floored;
    use nalgebra::{SMatrix, SVector};
    use proptest::prelude::{ProptestConfig, any, prop_assert, proptest};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]
        #[test]
        fn solves_positive_definite_systems(entries in proptest::array::uniform9(-1.0..1.0_f64), b in proptest::array::uniform3(-1.0..1.0_f64), _flip in any::<bool>()) {
            let m = SMatrix::<f64, 3, 3>::from_row_slice(&entries);
            let a = m * m.transpose() + SMatrix::<f64, 3, 3>::identity() * 0.1;
            let b = SVector::<f64, 3>::from(b);
            let (x, raised) = solve_symmetric_floored(&a, &b, 1e-6);
            prop_assert!(!raised);
            prop_assert!((a * x - b).norm() < 1e-12);
        }

        #[test]
        fn indefinite_systems_still_give_descent(entries in proptest::array::uniform6(-1.0..1.0_f64), b in proptest::array::uniform3(-1.0..1.0_f64)) {
            let [p, q, r, s, t, u] = entries;
            let a = SMatrix::<f64, 3, 3>::new(p, q, r, q, s, t, r, t, u);
            let b = SVector::<f64, 3>::from(b);
            let (x, _) = solve_symmetric_floored(&a, &b, 0.1);
            prop_assert!(b.norm() == 0.0 || x.dot(&b) > 0.0);
        }
    }
}
