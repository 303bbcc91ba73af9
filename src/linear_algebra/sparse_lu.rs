//! Sparse LU decomposition, with the library faer.

use super::SparseRows;
use super::mean_term::MeanTerm;
use faer::Col;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::solvers::Lu;
use faer::sparse::{SparseColMat, Triplet};

/// The decomposition of A, or of A + Σ_p α_p 1_p w_pᵀ for a matrix A that maps the constants of each part to zero.
///
/// The second matrix is dense. Instead, A is decomposed with β added to the first diagonal entry of each part, which makes
/// it regular. Woodbury's formula then accounts for both changes of each part. Rows must not reach into other parts.
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

/// Woodbury's correction, part by part, for U = (e_k, 1_p), Vᵀ = (e_kᵀ; w_pᵀ) and C = diag(−β, α_p), where B = A + β Σ e_k e_kᵀ
/// was decomposed and k is the first unknown of the part.
struct Correction {
    term: MeanTerm,
    first: Vec<usize>,
    /// The columns of B⁻¹ U of all parts together: parts do not mix.
    columns: [Vec<f64>; 2],
    /// The matrix C⁻¹ + Vᵀ B⁻¹ U of each part.
    small: Vec<[[f64; 2]; 2]>,
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
    /// Decomposes the matrix A with the given rows or, with a term of means, the sum of both.
    ///
    /// # Errors
    /// [`DecompositionFailed`] when the matrix is singular or too large.
    pub fn from_rows(rows: &SparseRows, term: Option<&MeanTerm>) -> Result<Self, DecompositionFailed> {
        let size = rows.rows();
        let failed = |reason: &str| DecompositionFailed { size, reason: reason.to_owned() };
        let first = term.map_or_else(Vec::new, MeanTerm::first_of_parts);
        let mut triplets = Vec::with_capacity(rows.entries() + first.len());
        let mut largest = 0.0_f64;
        for i in 0..size {
            let (columns, weights) = rows.row(i);
            triplets.extend(columns.iter().zip(weights).map(|(j, w)| Triplet::new(i, *j as usize, *w)));
            largest = weights.iter().fold(largest, |largest, w| largest.max(w.abs()));
        }
        // β has the magnitude of the largest entry and the sign of α.
        let alpha = term.and_then(|term| term.alpha().first().copied()).unwrap_or(1.0);
        let beta = largest.copysign(alpha);
        triplets.extend(first.iter().map(|k| Triplet::new(*k, *k, beta)));
        let matrix: SparseColMat<usize, f64> =
            SparseColMat::try_new_from_triplets(size, size, &triplets).map_err(|_| failed(TOO_LARGE))?;
        let factors = matrix.sp_lu().map_err(|error| match error {
            LuError::SymbolicSingular { index } => {
                failed(&format!("it is singular, no pivot was found in step {index}"))
            }
            LuError::Generic(_) => failed(TOO_LARGE),
        })?;
        let mut whole = Self { factors, size, correction: None };
        whole.correction = term.map(|term| whole.correct(term.clone(), first, beta));
        Ok(whole)
    }

    /// The correction for a term of means, where β was added to the diagonal entries of `first`.
    fn correct(&self, term: MeanTerm, first: Vec<usize>, beta: f64) -> Correction {
        let mut columns = [vec![0.0; self.size], vec![1.0; self.size]];
        first.iter().for_each(|k| columns[0][*k] = 1.0);
        columns.iter_mut().for_each(|column| self.solve_in_place(column));
        let means = [term.means(&columns[0]), term.means(&columns[1])];
        let small = |(p, k): (usize, &usize)| {
            let above = [columns[0][*k] - 1.0 / beta, columns[1][*k]];
            [above, [means[0][p], means[1][p] + 1.0 / term.alpha()[p]]]
        };
        let small = first.iter().enumerate().map(small).collect();
        Correction { term, first, columns, small }
    }

    /// Replaces a right-hand side by the solution with the decomposed matrix, without the correction.
    fn solve_in_place(&self, x: &mut [f64]) {
        let mut column = Col::from_fn(self.size, |i| x[i]);
        self.factors.solve_in_place(column.as_mut());
        x.iter_mut().enumerate().for_each(|(i, x)| *x = column[i]);
    }

    /// Writes the solution of A x = b, or with the term of means, to `x`.
    pub fn solve(&self, b: &[f64], x: &mut [f64]) {
        x.copy_from_slice(b);
        self.solve_in_place(x);
        let Some(Correction { term, first, columns, small }) = &self.correction else { return };
        let means = term.means(x);
        let share = |(p, [[a, b], [c, d]]): (usize, &[[f64; 2]; 2])| {
            let det = a * d - b * c;
            let (at_first, mean) = (x[first[p]], means[p]);
            [(d * at_first - b * mean) / det, (a * mean - c * at_first) / det]
        };
        let shares: Vec<[f64; 2]> = small.iter().enumerate().map(share).collect();
        for (i, (x, part)) in x.iter_mut().zip(term.parts()).enumerate() {
            let [first, second] = shares[*part as usize];
            *x -= first * columns[0][i] + second * columns[1][i];
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
    use super::{MeanTerm, SparseLu, SparseRows};

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
        for (diagonal, term) in [(-2.5, None), (-2.0, Some(MeanTerm::uniform(n, -0.3)))] {
            let a = ring(diagonal);
            let (mut b, mut x) = (vec![0.0; n], vec![0.0; n]);
            a.apply(&exact, &mut b);
            SparseLu::from_rows(&a, term.as_ref()).unwrap().solve(&b, &mut x);
            assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-10));
        }
    }

    /// Two rings: α times the mean of the solution is what must be taken from the right-hand side in each.
    #[test]
    fn each_part_gets_its_constant() {
        let n = 30;
        let mut rows = SparseRows::default();
        for i in 0..2 * n {
            let base = i / n * n;
            let near = [base + (i + n - 1) % n, i, base + (i + 1) % n];
            rows.push_row(&near.map(|j| j as u32), &[1.0, -2.0, 1.0]);
        }
        let alpha = [-0.3, -0.5];
        let parts = (0..2 * n).map(|i| (i / n) as u32).collect();
        let weights = (0..2 * n).map(|i| 1.0 + (i % 3) as f64).collect();
        let term = MeanTerm::new(parts, weights, alpha.to_vec());
        let b: Vec<f64> = (0..2 * n).map(|i| (i as f64).sin() + if i < n { 0.3 } else { -0.5 }).collect();
        let mut x = vec![0.0; 2 * n];
        SparseLu::from_rows(&rows, Some(&term)).unwrap().solve(&b, &mut x);
        let means = term.means(&x);
        let mut applied = vec![0.0; 2 * n];
        rows.apply(&x, &mut applied);
        for i in 0..2 * n {
            let constant = alpha[i / n] * means[i / n];
            assert!((applied[i] + constant - b[i]).abs() < 1e-10);
            // The rows are symmetric, so that the constant is the plain mean of b.
            let mean = b[i / n * n..i / n * n + n].iter().sum::<f64>() / n as f64;
            assert!((constant - mean).abs() < 1e-10);
        }
    }
}
