//! Sparse matrices in compressed rows. A row of an operator on points holds the neighbors of a point and their weights.

use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, IntoParallelRefMutIterator, ParallelIterator};

/// A sparse matrix in compressed rows.
///
/// ```
/// use meniscus::linear_algebra::SparseRows;
///
/// let mut difference = SparseRows::default();
/// difference.push_row(&[0, 1], &[-1.0, 1.0]);
/// difference.push_row(&[1, 2], &[-1.0, 1.0]);
/// let mut out = [0.0; 2];
/// difference.apply(&[1.0, 4.0, 9.0], &mut out);
/// assert_eq!(out, [3.0, 5.0]);
/// ```
#[derive(Debug, Clone)]
pub struct SparseRows {
    /// First entry of each row, and the number of entries at the end.
    starts: Vec<usize>,
    columns: Vec<u32>,
    weights: Vec<f64>,
}

/// Smallest number of rows of a parallel task.
const ROWS: usize = 512;

impl Default for SparseRows {
    /// A matrix without rows.
    fn default() -> Self {
        Self { starts: vec![0], columns: Vec::new(), weights: Vec::new() }
    }
}

impl SparseRows {
    /// Appends a row with the given columns and weights.
    pub fn push_row(&mut self, columns: &[u32], weights: &[f64]) {
        self.columns.extend_from_slice(columns);
        self.weights.extend_from_slice(weights);
        self.starts.push(self.columns.len());
    }

    /// The rows of several matrices, one after another.
    pub fn stacked<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let entries = parts.clone().map(Self::entries).sum();
        let mut starts = Vec::with_capacity(parts.clone().map(Self::rows).sum::<usize>() + 1);
        starts.push(0);
        let mut whole = Self { starts, columns: Vec::with_capacity(entries), weights: Vec::with_capacity(entries) };
        for part in parts {
            let before = whole.columns.len();
            whole.columns.extend_from_slice(&part.columns);
            whole.weights.extend_from_slice(&part.weights);
            whole.starts.extend(part.starts[1..].iter().map(|start| start + before));
        }
        whole
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of entries of all rows together.
    #[must_use]
    pub fn entries(&self) -> usize {
        self.columns.len()
    }

    /// Columns and weights of row i.
    #[must_use]
    pub fn row(&self, i: usize) -> (&[u32], &[f64]) {
        let row = self.starts[i]..self.starts[i + 1];
        (&self.columns[row.clone()], &self.weights[row])
    }

    /// The same matrix with the columns of every row in ascending order and each column once; repeated entries are
    /// added up.
    #[must_use]
    pub fn sorted(&self) -> Self {
        let mut sorted = Self {
            starts: Vec::with_capacity(self.starts.len()),
            columns: Vec::with_capacity(self.entries()),
            weights: Vec::with_capacity(self.entries()),
        };
        sorted.starts.push(0);
        let mut row: Vec<(u32, f64)> = Vec::new();
        for i in 0..self.rows() {
            let (columns, weights) = self.row(i);
            row.clear();
            row.extend(columns.iter().copied().zip(weights.iter().copied()));
            // A stable sort: equal columns are added in their original order.
            row.sort_by_key(|(column, _)| *column);
            for (column, weight) in &row {
                let begun = sorted.columns.len() > sorted.starts[i];
                match sorted.weights.last_mut() {
                    Some(last) if begun && sorted.columns.last() == Some(column) => *last += weight,
                    _ => {
                        sorted.columns.push(*column);
                        sorted.weights.push(*weight);
                    }
                }
            }
            sorted.starts.push(sorted.columns.len());
        }
        sorted
    }

    /// The same matrix with other numbers of its columns; the columns of every row are ascending, and equal ones are added up.
    #[must_use]
    pub fn renumbered(mut self, numbers: &[u32]) -> Self {
        self.columns.iter_mut().for_each(|column| *column = numbers[*column as usize]);
        self.sorted()
    }

    /// Changes the weights row by row. `change` gets the index, the columns and the weights of a row.
    pub fn change_rows(&mut self, mut change: impl FnMut(usize, &[u32], &mut [f64])) {
        for i in 0..self.rows() {
            let row = self.starts[i]..self.starts[i + 1];
            change(i, &self.columns[row.clone()], &mut self.weights[row]);
        }
    }

    /// The norm ‖A‖∞ = max_i Σ_j |w_ij|.
    #[must_use]
    pub fn infinity_norm(&self) -> f64 {
        let sum = |i: usize| self.row(i).1.iter().map(|weight| weight.abs()).sum::<f64>();
        // A maximum does not depend on the order of the tasks.
        (0..self.rows()).into_par_iter().with_min_len(ROWS).map(sum).reduce(|| 0.0, f64::max)
    }

    /// Writes out_i = Σ_j w_ij f_j, each sum in the order of its row.
    pub fn apply(&self, field: &[f64], out: &mut [f64]) {
        out.par_iter_mut().with_min_len(ROWS).enumerate().for_each(|(i, out)| {
            let row = self.starts[i]..self.starts[i + 1];
            let entries = self.columns[row.clone()].iter().zip(&self.weights[row]);
            *out = entries.map(|(column, weight)| weight * field[*column as usize]).sum();
        });
    }
}

#[cfg(test)]
mod tests {
    use super::SparseRows;

    #[test]
    fn rows_are_sums() {
        let mut first = SparseRows::default();
        first.push_row(&[0, 2], &[1.0, -2.0]);
        first.push_row(&[], &[]);
        let mut second = SparseRows::default();
        second.push_row(&[1], &[3.0]);
        let operator = SparseRows::stacked([&first, &second].into_iter());
        let mut out = [7.0; 3];
        operator.apply(&[1.0, 2.0, 3.0], &mut out);
        assert_eq!((out, operator.rows(), operator.entries()), ([-5.0, 0.0, 6.0], 3, 3));
        assert!((operator.infinity_norm() - 3.0).abs() < f64::EPSILON);
    }

    #[test]
    fn sorting_adds_up_repeated_columns() {
        let mut operator = SparseRows::default();
        operator.push_row(&[2, 0, 2], &[1.0, 4.0, 2.0]);
        operator.push_row(&[0], &[7.0]);
        let sorted = operator.sorted();
        assert_eq!(sorted.row(0), ([0, 2].as_slice(), [4.0, 3.0].as_slice()));
        assert_eq!(sorted.row(1), ([0].as_slice(), [7.0].as_slice()));
    }
}
