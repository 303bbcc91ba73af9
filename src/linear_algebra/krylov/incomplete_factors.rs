//! The incomplete factorization L U ≈ A with the pattern of A, ILU(0), as a preconditioner.

use crate::linear_algebra::SparseRows;

/// The factors L and U in the pattern of A. The unit diagonal of L is not stored, and the diagonal of U is stored
/// inverted.
#[derive(Debug)]
pub struct IncompleteFactors {
    rows: SparseRows,
    /// Number of entries of each row to the left of the diagonal.
    left: Vec<u32>,
    inverse: Vec<f64>,
}

/// A row has no diagonal entry, or its pivot became zero or not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("row {row} has no pivot that a factorization could divide by")]
pub struct NoPivot {
    /// Index of the row.
    pub row: usize,
}

impl IncompleteFactors {
    /// Factorizes a matrix whose rows are sorted ([`SparseRows::sorted`]).
    ///
    /// # Errors
    /// [`NoPivot`] names the first row without a usable pivot.
    pub fn from_rows(a: &SparseRows) -> Result<Self, NoPivot> {
        let mut rows = a.clone();
        let n = rows.rows();
        let (mut left, mut inverse) = (Vec::with_capacity(n), Vec::with_capacity(n));
        // Position of each column within the present row.
        let mut place = vec![u32::MAX; n];
        let mut finished = SparseRows::default();
        let mut broken = None;
        rows.change_rows(|i, columns, weights| {
            for (k, column) in columns.iter().enumerate() {
                place[*column as usize] = k as u32;
            }
            let before = columns.partition_point(|column| (*column as usize) < i);
            for k in 0..before {
                let j = columns[k] as usize;
                let factor = weights[k] * inverse[j];
                weights[k] = factor;
                let (above, upper): (&[u32], &[f64]) = finished.row(j);
                let from = left[j] as usize + 1;
                for (column, u) in above[from..].iter().zip(&upper[from..]) {
                    let at = place[*column as usize];
                    if at != u32::MAX {
                        weights[at as usize] -= factor * u;
                    }
                }
            }
            let has_diagonal = columns.get(before).is_some_and(|column| *column as usize == i);
            let pivot = if has_diagonal { weights[before] } else { 0.0 };
            if broken.is_none() && !(pivot.abs() > 0.0 && pivot.is_finite()) {
                broken = Some(NoPivot { row: i });
            }
            left.push(before as u32);
            inverse.push(1.0 / pivot);
            for column in columns {
                place[*column as usize] = u32::MAX;
            }
            finished.push_row(columns, weights);
        });
        match broken {
            Some(broken) => Err(broken),
            None => Ok(Self { rows: finished, left, inverse }),
        }
    }

    /// Whether all pivots are positive. Those of a symmetric matrix then are incomplete Cholesky factors.
    #[must_use]
    pub fn has_positive_pivots(&self) -> bool {
        self.inverse.iter().all(|inverse| *inverse > 0.0)
    }

    /// Writes (L U)⁻¹ b to `x`.
    pub fn solve(&self, b: &[f64], x: &mut [f64]) {
        for i in 0..b.len() {
            let (columns, weights) = self.rows.row(i);
            let before = self.left[i] as usize;
            let products = columns[..before].iter().zip(&weights[..before]);
            x[i] = b[i] - products.map(|(j, l)| l * x[*j as usize]).sum::<f64>();
        }
        for i in (0..b.len()).rev() {
            let (columns, weights) = self.rows.row(i);
            let after = self.left[i] as usize + 1;
            let products = columns[after..].iter().zip(&weights[after..]);
            x[i] = (x[i] - products.map(|(j, u)| u * x[*j as usize]).sum::<f64>()) * self.inverse[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{IncompleteFactors, NoPivot, SparseRows};

    #[test]
    fn a_full_pattern_is_solved_exactly() {
        let a = [[4.0, 1.0, 0.5], [1.0, 3.0, -1.0], [0.2, 2.0, 5.0]];
        let mut rows = SparseRows::default();
        a.iter().for_each(|row| rows.push_row(&[0, 1, 2], row));
        let exact = [1.0, -2.0, 3.0];
        let b: Vec<f64> = a.iter().map(|row| row.iter().zip(&exact).map(|(a, x)| a * x).sum()).collect();
        let mut x = [0.0; 3];
        IncompleteFactors::from_rows(&rows).unwrap().solve(&b, &mut x);
        assert!(x.iter().zip(&exact).all(|(x, e): (&f64, &f64)| (x - e).abs() < 1e-12));
    }

    #[test]
    fn a_row_without_pivot_is_named() {
        let mut rows = SparseRows::default();
        rows.push_row(&[0], &[1.0]);
        rows.push_row(&[0], &[1.0]);
        assert_eq!(IncompleteFactors::from_rows(&rows).unwrap_err(), NoPivot { row: 1 });
    }
}
