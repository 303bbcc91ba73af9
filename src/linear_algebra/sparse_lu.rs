//! Sparse LU decomposition, with the library faer.

use super::SparseRows;
use faer::Col;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::solvers::Lu;
use faer::sparse::{SparseColMat, Triplet};

/// The decomposition of A, or of A + α 1 1ᵀ/n for a matrix A that maps constants to zero.
///
/// The second matrix is dense. Instead, A is decomposed with β added to its first diagonal entry, which makes it
/// regular. Woodbury's formula then accounts for both changes of rank one.
///
/// ```
/// use meniscus::linear_algebra::{SparseRows, sparse_lu::SparseLu};
///
/// let mut rows = SparseRows::default();
/// rows.push_row(&[0, 1], &[2.0, 1.0]);
/// rows.push_row(&[1], &[4.0]);
/// let mut x = [0.0; 2];
/// SparseLu::from_rows(&rows, None).unwrap().solve(&[4.0, 8.0], &mut x);
/// assert_eq!(x, [1.0, 2.0]);
/// ```
pub struct SparseLu {
    factors: Lu<usize, f64>,
    size: usize,
    correction: Option<Correction>,
}

/// Woodbury's correction for U = (e₀, 1) and C = diag(−β, α/n), where B = A + β e₀ e₀ᵀ was decomposed.
struct Correction {
    /// The columns of B⁻¹ U.
    columns: [Vec<f64>; 2],
    /// The matrix C⁻¹ + Uᵀ B⁻¹ U.
    small: [[f64; 2]; 2],
}

/// Reason of a failure that is not one of the numbers.
const TOO_LARGE: &str = "it is too large for the memory or for the indices";

/// The matrix is singular or too large to be decomposed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("sparse LU decomposition of {size} rows failed: {reason}")]
pub struct DecompositionFailed {
    /// Number of rows of the matrix.
    pub size: usize,
    /// The reason that the library gives.
    pub reason: String,
}

impl SparseLu {
    /// Decomposes the matrix A with the given rows or, with `alpha`, the matrix A + α 1 1ᵀ/n.
    ///
    /// # Errors
    /// [`DecompositionFailed`] when the matrix is singular or too large.
    pub fn from_rows(rows: &SparseRows, alpha: Option<f64>) -> Result<Self, DecompositionFailed> {
        let size = rows.rows();
        let failed = |reason: &str| DecompositionFailed { size, reason: reason.to_owned() };
        let mut triplets = Vec::with_capacity(rows.entries() + 1);
        let mut largest = 0.0_f64;
        for i in 0..size {
            let (columns, weights) = rows.row(i);
            triplets.extend(columns.iter().zip(weights).map(|(j, w)| Triplet::new(i, *j as usize, *w)));
            largest = weights.iter().fold(largest, |largest, w| largest.max(w.abs()));
        }
        // β has the magnitude of the largest entry and the sign of α.
        let beta = alpha.map(|alpha| largest.copysign(alpha));
        triplets.extend(beta.map(|beta| Triplet::new(0, 0, beta)));
        let matrix: SparseColMat<usize, f64> =
            SparseColMat::try_new_from_triplets(size, size, &triplets).map_err(|_| failed(TOO_LARGE))?;
        let factors = matrix.sp_lu().map_err(|error| match error {
            LuError::SymbolicSingular { index } => {
                failed(&format!("it is singular, no pivot was found in step {index}"))
            }
            LuError::Generic(_) => failed(TOO_LARGE),
        })?;
        let mut whole = Self { factors, size, correction: None };
        if let (Some(alpha), Some(beta)) = (alpha, beta) {
            let mut columns = [vec![0.0; size], vec![1.0; size]];
            columns[0][0] = 1.0;
            columns.iter_mut().for_each(|column| whole.solve_in_place(column));
            let sum = |v: &[f64]| v.iter().sum::<f64>();
            let small = [
                [columns[0][0] - 1.0 / beta, columns[1][0]],
                [sum(&columns[0]), sum(&columns[1]) + size as f64 / alpha],
            ];
            whole.correction = Some(Correction { columns, small });
        }
        Ok(whole)
    }

    /// Replaces a right-hand side by the solution with the decomposed matrix, without the correction.
    fn solve_in_place(&self, x: &mut [f64]) {
        let mut column = Col::from_fn(self.size, |i| x[i]);
        self.factors.solve_in_place(column.as_mut());
        x.iter_mut().enumerate().for_each(|(i, x)| *x = column[i]);
    }

    /// Writes the solution of A x = b, or of (A + α 1 1ᵀ/n) x = b, to `x`.
    pub fn solve(&self, b: &[f64], x: &mut [f64]) {
        x.copy_from_slice(b);
        self.solve_in_place(x);
        if let Some(Correction { columns, small: [[a, b], [c, d]] }) = &self.correction {
            let (first, second) = (x[0], x.iter().sum::<f64>());
            let det = a * d - b * c;
            let share = [(d * first - b * second) / det, (a * second - c * first) / det];
            for (i, x) in x.iter_mut().enumerate() {
                *x -= share[0] * columns[0][i] + share[1] * columns[1][i];
            }
        }
    }
}

impl std::fmt::Debug for SparseLu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SparseLu").field("size", &self.size).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::{SparseLu, SparseRows};

    #[test]
    fn solves_with_and_without_a_mean() {
        let n = 50;
        let ring = |diagonal: f64| {
            let mut rows = SparseRows::default();
            for i in 0..n {
                rows.push_row(&[((i + n - 1) % n) as u32, i as u32, ((i + 1) % n) as u32], &[1.0, diagonal, 1.0]);
            }
            rows
        };
        let exact: Vec<f64> = (0..n).map(|i| (std::f64::consts::TAU * i as f64 / n as f64).sin()).collect();
        for (diagonal, alpha) in [(-2.5, None), (-2.0, Some(-0.3))] {
            let a = ring(diagonal);
            let (mut b, mut x) = (vec![0.0; n], vec![0.0; n]);
            a.apply(&exact, &mut b);
            SparseLu::from_rows(&a, alpha).unwrap().solve(&b, &mut x);
            assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-10));
        }
    }
}
