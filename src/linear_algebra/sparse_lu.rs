//! Sparse LU decomposition, by faer.

use super::SparseRows;
use faer::Col;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::Lu;
use faer::sparse::{SparseColMat, Triplet};

/// A decomposition that solves for any right-hand side.
pub struct SparseLu {
    factors: Lu<usize, f64>,
    size: usize,
    is_bordered: bool,
}

/// The matrix is singular, or too large.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("sparse LU decomposition of {size} rows failed: {reason}")]
pub struct Undecomposed {
    /// Rows.
    pub size: usize,
    /// What the library says.
    pub reason: String,
}

impl SparseLu {
    /// Of A, or with a border of ones that takes the mean of a solution away and lets a right-hand side have one.
    ///
    /// # Errors
    /// [`Undecomposed`].
    pub fn of(rows: &SparseRows, is_bordered: bool) -> Result<Self, Undecomposed> {
        let n = rows.rows();
        let size = n + usize::from(is_bordered);
        let failed = |reason: String| Undecomposed { size, reason };
        let mut triplets = Vec::with_capacity(rows.entries() + 2 * n);
        for i in 0..n {
            let (columns, weights) = rows.row(i);
            triplets.extend(columns.iter().zip(weights).map(|(j, w)| Triplet::new(i, *j as usize, *w)));
        }
        if is_bordered {
            triplets.extend((0..n).flat_map(|i| [Triplet::new(i, n, 1.0), Triplet::new(n, i, 1.0)]));
        }
        let matrix: SparseColMat<usize, f64> =
            SparseColMat::try_new_from_triplets(size, size, &triplets).map_err(|error| failed(format!("{error:?}")))?;
        let factors = matrix.sp_lu().map_err(|error| failed(format!("{error:?}")))?;
        Ok(Self { factors, size: n, is_bordered })
    }

    /// x with A x = b.
    pub fn solve(&self, b: &[f64], x: &mut [f64]) {
        let rows = self.size + usize::from(self.is_bordered);
        let mut column = Col::from_fn(rows, |i| b.get(i).copied().unwrap_or(0.0));
        self.factors.solve_in_place(column.as_mut());
        x.iter_mut().enumerate().for_each(|(i, x)| *x = column[i]);
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
        for (diagonal, is_bordered) in [(-2.5, false), (-2.0, true)] {
            let a = ring(diagonal);
            let (mut b, mut x) = (vec![0.0; n], vec![0.0; n]);
            a.apply(&exact, &mut b);
            SparseLu::of(&a, is_bordered).unwrap().solve(&b, &mut x);
            assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-11));
        }
    }
}
