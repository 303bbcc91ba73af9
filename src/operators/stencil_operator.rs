//! A linear operator as sparse rows: each point its neighbours and their weights.

use rayon::prelude::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};

/// Rows of (column, weight); compressed.
#[derive(Debug, Clone)]
pub struct StencilOperator {
    starts: Vec<usize>,
    columns: Vec<u32>,
    weights: Vec<f64>,
}

/// Rows that one task applies at least.
const ROWS: usize = 512;

impl Default for StencilOperator {
    /// No rows yet.
    fn default() -> Self {
        Self { starts: vec![0], columns: Vec::new(), weights: Vec::new() }
    }
}

impl StencilOperator {
    /// Adds a row.
    pub fn push_row(&mut self, columns: &[u32], weights: &[f64]) {
        self.columns.extend_from_slice(columns);
        self.weights.extend_from_slice(weights);
        self.starts.push(self.columns.len());
    }

    /// The rows of several operators, one after another, in room of their size.
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

    /// Rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// Entries of all rows.
    #[must_use]
    pub fn entries(&self) -> usize {
        self.columns.len()
    }

    /// out_i = Σ_j w_ij f_j, each sum in the order of its row.
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
    use super::StencilOperator;

    #[test]
    fn rows_are_sums() {
        let mut first = StencilOperator::default();
        first.push_row(&[0, 2], &[1.0, -2.0]);
        first.push_row(&[], &[]);
        let mut second = StencilOperator::default();
        second.push_row(&[1], &[3.0]);
        let operator = StencilOperator::stacked([&first, &second].into_iter());
        let mut out = [7.0; 3];
        operator.apply(&[1.0, 2.0, 3.0], &mut out);
        assert_eq!((out, operator.rows(), operator.entries()), ([-5.0, 0.0, 6.0], 3, 3));
    }
}
