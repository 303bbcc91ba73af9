//! Dense least squares by Householder QR with column pivoting.
//!
//! Columns are scaled to length one, the decomposition reveals the rank, and repeated solves allocate nothing.

/// Workspace for problems `min ‖A c − b‖` with a matrix of `rows × columns`, stored by columns.
///
/// ```
/// use meniscus::linear_algebra::least_squares::LeastSquares;
///
/// // The line c₀ + c₁ t through (0, 1), (1, 3), (2, 5).
/// let mut problem = LeastSquares::default();
/// problem.reset(3, 2);
/// for k in 0..3 {
///     let t = k as f64;
///     problem.set_row(k, &[1.0, t], 1.0 + 2.0 * t);
/// }
/// let (factorization, c) = problem.solve();
/// assert_eq!(factorization.rank, 2);
/// assert!((c[0] - 1.0).abs() < 1e-12 && (c[1] - 2.0).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Default)]
pub struct LeastSquares {
    rows: usize,
    columns: usize,
    matrix: Vec<f64>,
    rhs: Vec<f64>,
    scales: Vec<f64>,
    order: Vec<usize>,
    diagonal: Vec<f64>,
    solution: Vec<f64>,
}

/// Rank and condition of the matrix of a solved problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factorization {
    /// Number of linearly independent columns: those with a pivot above `1e-12` of the scaled columns.
    pub rank: usize,
    /// Ratio of the largest to the smallest pivot of the scaled matrix, an estimate of its condition number.
    pub condition: f64,
}

/// Pivots of the scaled matrix (columns of length one) below this value count as zero.
const RANK_TOLERANCE: f64 = 1e-12;

impl LeastSquares {
    /// Starts a problem of the given shape. Every row must then be written by [`Self::set_row`].
    pub fn reset(&mut self, rows: usize, columns: usize) {
        self.rows = rows;
        self.columns = columns;
        self.matrix.resize(rows * columns, 0.0);
        self.rhs.resize(rows, 0.0);
        self.scales.resize(columns, 0.0);
        self.order.resize(columns, 0);
        self.diagonal.resize(columns, 0.0);
        self.solution.resize(columns, 0.0);
    }

    /// Writes one row of the matrix and its entry of the right-hand side.
    #[inline]
    pub fn set_row(&mut self, row: usize, values: &[f64], rhs: f64) {
        for (k, value) in values.iter().enumerate() {
            self.matrix[k * self.rows + row] = *value;
        }
        self.rhs[row] = rhs;
    }

    /// Factorizes the matrix and solves the problem.
    ///
    /// The solution of a rank-deficient problem is basic: the coefficients of columns beyond the rank are zero.
    pub fn solve(&mut self) -> (Factorization, &[f64]) {
        let (m, n) = (self.rows, self.columns);
        for k in 0..n {
            let column = &mut self.matrix[k * m..(k + 1) * m];
            let norm = dot(column, column).sqrt();
            let scale = if norm > 0.0 { 1.0 / norm } else { 0.0 };
            column.iter_mut().for_each(|a| *a *= scale);
            self.scales[k] = scale;
            self.order[k] = k;
        }
        let mut rank = 0;
        for k in 0..n.min(m) {
            let pivot = (k..n)
                .map(|j| (j, tail_norm(&self.matrix[j * m + k..(j + 1) * m])))
                .fold((k, -1.0), |best, next| if next.1 > best.1 { next } else { best });
            if pivot.1 <= RANK_TOLERANCE {
                break;
            }
            self.exchange(k, pivot.0);
            self.reflect(k, pivot.1);
            rank = k + 1;
        }
        let condition = if rank < n {
            f64::INFINITY
        } else {
            let (largest, least) = self.diagonal[..n]
                .iter()
                .fold((0.0_f64, f64::INFINITY), |(largest, least), d| (largest.max(d.abs()), least.min(d.abs())));
            largest / least
        };
        self.back_substitute(rank);
        (Factorization { rank, condition }, &self.solution[..n])
    }

    /// Exchanges the columns k < j.
    fn exchange(&mut self, k: usize, j: usize) {
        if k != j {
            let m = self.rows;
            let (left, right) = self.matrix.split_at_mut(j * m);
            left[k * m..(k + 1) * m].swap_with_slice(&mut right[..m]);
            self.scales.swap(k, j);
            self.order.swap(k, j);
        }
    }

    /// Applies the Householder reflection that clears column k below its diagonal to the later columns and to b.
    fn reflect(&mut self, k: usize, norm: f64) {
        let m = self.rows;
        let (done, rest) = self.matrix.split_at_mut((k + 1) * m);
        let v = &mut done[k * m + k..(k + 1) * m];
        let alpha = if v[0] > 0.0 { -norm } else { norm };
        self.diagonal[k] = alpha;
        v[0] -= alpha;
        let beta = -1.0 / (alpha * v[0]);
        for column in rest.chunks_exact_mut(m).take(self.columns - k - 1) {
            let tail = &mut column[k..];
            let s = beta * dot(v, tail);
            tail.iter_mut().zip(v.iter()).for_each(|(a, v)| *a -= s * v);
        }
        let tail = &mut self.rhs[k..m];
        let s = beta * dot(v, tail);
        tail.iter_mut().zip(v.iter()).for_each(|(a, v)| *a -= s * v);
    }

    /// Solves with the leading `rank × rank` triangle of R and undoes scaling and pivoting.
    fn back_substitute(&mut self, rank: usize) {
        let (m, n) = (self.rows, self.columns);
        for k in (0..rank).rev() {
            let mut sum = self.rhs[k];
            for j in k + 1..rank {
                // The rows of R above the diagonal have replaced the matrix.
                sum -= self.matrix[j * m + k] * self.rhs[j];
            }
            self.rhs[k] = sum / self.diagonal[k];
        }
        for k in 0..n {
            self.solution[self.order[k]] = if k < rank { self.rhs[k] * self.scales[k] } else { 0.0 };
        }
    }
}

/// Euclidean norm of the part of a column that is not yet triangular.
fn tail_norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

/// Scalar product a·b as eight partial sums in a fixed order, which the compiler keeps in vector registers.
#[inline]
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a_blocks, a_rest) = a.as_chunks::<8>();
    let (b_blocks, b_rest) = b.as_chunks::<8>();
    for (a, b) in a_blocks.iter().zip(b_blocks) {
        for l in 0..8 {
            lanes[l] += a[l] * b[l];
        }
    }
    let mut sum = ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
    for (a, b) in a_rest.iter().zip(b_rest) {
        sum += a * b;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::{LeastSquares, dot};
    use crate::geometry::random::CounterRandom;

    fn problem(
        rows: usize,
        columns: usize,
        entry: impl Fn(usize, usize) -> f64,
        rhs: impl Fn(usize) -> f64,
    ) -> LeastSquares {
        let mut system = LeastSquares::default();
        system.reset(rows, columns);
        for i in 0..rows {
            let row: Vec<f64> = (0..columns).map(|k| entry(i, k)).collect();
            system.set_row(i, &row, rhs(i));
        }
        system
    }

    #[test]
    fn residual_is_orthogonal_to_every_column() {
        let random = CounterRandom::new(3);
        let entry = |i: usize, k: usize| random.symmetric(&[i as i64, k as i64]) * 10.0_f64.powi(k as i32 - 3);
        let rhs = |i: usize| random.symmetric(&[i as i64, 99]);
        for (rows, columns) in [(15, 15), (24, 15), (59, 35), (700, 15), (7, 3)] {
            let mut system = problem(rows, columns, entry, rhs);
            let (found, solution) = system.solve();
            assert_eq!(found.rank, columns);
            for k in 0..columns {
                let residual = |i: usize| (0..columns).map(|j| entry(i, j) * solution[j]).sum::<f64>() - rhs(i);
                let along: f64 = (0..rows).map(|i| residual(i) * entry(i, k)).sum();
                let size: f64 = (0..rows).map(|i| entry(i, k).abs()).sum();
                assert!(along.abs() < 1e-12 * size, "{rows}×{columns}, column {k}: {along}");
            }
        }
    }

    #[test]
    fn dependent_columns_lower_the_rank() {
        let random = CounterRandom::new(4);
        let entry = |i: usize, k: usize| match k {
            3 => random.symmetric(&[i as i64, 0]) + 2.0 * random.symmetric(&[i as i64, 1]),
            _ => random.symmetric(&[i as i64, k as i64]),
        };
        let mut system = problem(30, 5, entry, |_| 1.0);
        let (found, _) = system.solve();
        assert_eq!(found.rank, 4);
        assert!(found.condition.is_infinite());
    }

    #[test]
    fn fewer_rows_than_columns_is_a_low_rank() {
        let random = CounterRandom::new(5);
        let mut system = problem(3, 6, |i, k| random.symmetric(&[i as i64, k as i64]), |_| 1.0);
        assert_eq!(system.solve().0.rank, 3);
    }

    #[test]
    fn blocked_product_equals_the_plain_one() {
        let random = CounterRandom::new(6);
        for n in 0..40 {
            let a: Vec<f64> = (0..n).map(|i| random.symmetric(&[i, 0])).collect();
            let b: Vec<f64> = (0..n).map(|i| random.symmetric(&[i, 1])).collect();
            let plain: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            assert!((dot(&a, &b) - plain).abs() < 1e-14);
        }
    }
}
