//! Sparse Cholesky decomposition, with the library faer.

use super::SparseRows;
use faer::Col;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::Llt;
use faer::sparse::{SparseColMat, Triplet};

/// The decomposition A = L Lᵀ of a symmetric positive definite matrix.
///
/// Where no weight beside the diagonal is positive, the solution for a right-hand side without negative entries has small relative
/// errors entry by entry, since nothing cancels.
///
/// ```
/// use meniscus::linear_algebra::{SparseRows, sparse_cholesky::SparseCholesky};
///
/// let mut rows = SparseRows::default();
/// rows.push_row(&[0, 1], &[2.0, -1.0]);
/// rows.push_row(&[0, 1], &[-1.0, 2.0]);
/// let mut x = [3.0, 0.0];
/// SparseCholesky::from_rows(&rows).unwrap().solve_in_place(&mut x);
/// assert!((x[0] - 2.0).abs() < 1e-15 && (x[1] - 1.0).abs() < 1e-15);
/// ```
pub struct SparseCholesky {
    factors: Llt<usize, f64>,
    size: usize,
}

/// The matrix is not positive definite, or too large to be decomposed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the matrix of {size} rows is not positive definite, or too large to be decomposed")]
pub struct NotDefinite {
    /// Number of rows of the matrix.
    pub size: usize,
}

impl SparseCholesky {
    /// Decomposes the symmetric matrix with the given rows. Only its lower triangle is read.
    ///
    /// # Errors
    /// [`NotDefinite`] when a pivot is not positive, or when memory does not suffice.
    pub fn from_rows(rows: &SparseRows) -> Result<Self, NotDefinite> {
        let size = rows.rows();
        let mut triplets = Vec::with_capacity(rows.entries() / 2 + size);
        for i in 0..size {
            let (columns, weights) = rows.row(i);
            let lower = columns.iter().zip(weights).filter(|(j, _)| **j as usize <= i);
            triplets.extend(lower.map(|(j, w)| Triplet::new(i, *j as usize, *w)));
        }
        let matrix: SparseColMat<usize, f64> =
            SparseColMat::try_new_from_triplets(size, size, &triplets).map_err(|_| NotDefinite { size })?;
        let factors = matrix.sp_cholesky(faer::Side::Lower).map_err(|_| NotDefinite { size })?;
        Ok(Self { factors, size })
    }

    /// Replaces a right-hand side b by the solution of A x = b.
    pub fn solve_in_place(&self, x: &mut [f64]) {
        let mut column = Col::from_fn(self.size, |i| x[i]);
        self.factors.solve_in_place(column.as_mut());
        x.iter_mut().enumerate().for_each(|(i, x)| *x = column[i]);
    }
}

impl std::fmt::Debug for SparseCholesky {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SparseCholesky").field("size", &self.size).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::{NotDefinite, SparseCholesky, SparseRows};

    fn ring(n: usize, diagonal: f64) -> SparseRows {
        let mut rows = SparseRows::default();
        for i in 0..n {
            rows.push_row(&[((i + n - 1) % n) as u32, i as u32, ((i + 1) % n) as u32], &[-1.0, diagonal, -1.0]);
        }
        rows
    }

    /// The solution for one point decays like r^−d, over hundreds of powers of ten.
    #[test]
    fn what_decays_keeps_its_digits() {
        let n = 600;
        let mut x = vec![0.0; n];
        x[0] = 1.0;
        SparseCholesky::from_rows(&ring(n, 12.0)).unwrap().solve_in_place(&mut x);
        let ratio = 6.0 + 35.0_f64.sqrt();
        for d in [1, 100, 250] {
            let exact = ratio.powi(-d) / (ratio - 1.0 / ratio);
            let found = x[d as usize];
            assert!((found / exact - 1.0).abs() < 1e-12, "{d}: {found:e} for {exact:e}");
        }
    }

    #[test]
    fn what_is_not_definite_is_an_error() {
        assert_eq!(SparseCholesky::from_rows(&ring(50, 1.5)).err(), Some(NotDefinite { size: 50 }));
    }
}
