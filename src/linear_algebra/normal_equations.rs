//! Symmetric positive definite systems of equal size, one in each vector lane, by L D Lᵀ.
//!
//! Regressions with moderately conditioned matrices are solved this way at a fraction of the cost of an orthogonal
//! decomposition. Normal equations square the condition number. The pivots show how many digits that costs.

use super::number::Lanes;

/// Systems `G c = b`, one per lane, and the workspace of their factorization.
///
/// Only the lower triangle of G is stored, row by row, with the diagonal entry last in its row.
#[derive(Debug, Clone, Default)]
pub struct LaneSystems {
    size: usize,
    /// G before [`Self::factorize`]; afterwards L below the diagonal and 1/d on it.
    matrix: Vec<Lanes>,
    /// Two rows of L D during the factorization.
    row: Vec<Lanes>,
}

/// Index of the first entry of row i in a packed lower triangle.
#[inline(always)]
#[must_use]
pub fn packed_row(i: usize) -> usize {
    i * (i + 1) / 2
}

impl LaneSystems {
    /// Sets the number of unknowns. The matrix must then be written through [`Self::matrix_mut`].
    pub fn reset(&mut self, size: usize) {
        self.size = size;
        self.matrix.resize(packed_row(size), Lanes::splat(0.0));
        self.row.resize(2 * size, Lanes::splat(0.0));
    }

    /// The packed lower triangle of G, for writing.
    pub fn matrix_mut(&mut self) -> &mut [Lanes] {
        &mut self.matrix
    }

    /// Factorizes all matrices in place and returns the smallest pivot ratio d_i/G_ii of each lane.
    ///
    /// The ratio measures how far a column is from a combination of the columns before it. A matrix with a ratio that
    /// is zero, negative or NaN is rank-deficient.
    pub fn factorize(&mut self) -> Lanes {
        let n = self.size;
        let one = Lanes::splat(1.0);
        let mut least = one;
        let (first, second) = self.row.split_at_mut(n);
        // Two rows are processed together, so that they share the loads of the rows above.
        let mut i = 0;
        while i < n {
            let pair = i + 1 < n;
            let (above, below) = self.matrix.split_at_mut(packed_row(i));
            let (row, next) = below.split_at_mut(i + 1);
            if pair {
                for j in 0..i {
                    let l = &above[packed_row(j)..=packed_row(j) + j];
                    let (mut a, mut b) = (row[j], next[j]);
                    for k in 0..j {
                        a = (-first[k]).mul_add(l[k], a);
                        b = (-second[k]).mul_add(l[k], b);
                    }
                    first[j] = a;
                    second[j] = b;
                }
            } else {
                for j in 0..i {
                    let l = &above[packed_row(j)..=packed_row(j) + j];
                    let mut a = row[j];
                    for k in 0..j {
                        a = (-first[k]).mul_add(l[k], a);
                    }
                    first[j] = a;
                }
            }
            let inverse_of = |j: usize| above[packed_row(j) + j];
            let inverse = finish_row(i, row, first, &inverse_of, &mut least);
            if pair {
                let mut last = next[i];
                for k in 0..i {
                    last = (-second[k]).mul_add(row[k], last);
                }
                second[i] = last;
                let inverse_of = |j: usize| if j == i { inverse } else { above[packed_row(j) + j] };
                finish_row(i + 1, next, second, &inverse_of, &mut least);
            }
            i += 2;
        }
        least
    }

    /// Solves all systems for one right-hand side, which is replaced by the solution.
    pub fn solve(&self, b: &mut [Lanes]) {
        let n = self.size;
        for i in 0..n {
            let row = &self.matrix[packed_row(i)..packed_row(i) + i];
            let mut sum = b[i];
            for (l, x) in row.iter().zip(b.iter()) {
                sum = (-*l).mul_add(*x, sum);
            }
            b[i] = sum;
        }
        for (i, x) in b.iter_mut().enumerate() {
            *x *= self.matrix[packed_row(i) + i];
        }
        for i in (0..n).rev() {
            let x = b[i];
            for (sum, l) in b[..i].iter_mut().zip(&self.matrix[packed_row(i)..]) {
                *sum = (-*l).mul_add(x, *sum);
            }
        }
    }
}

/// Turns row i of L D, given as `scaled`, into that of L, and writes 1/d_i on the diagonal. Returns 1/d_i.
///
/// `inverse_of(j)` is 1/d_j of an earlier row. `least` is lowered to the pivot ratio of row i.
#[inline(always)]
fn finish_row(
    i: usize,
    row: &mut [Lanes],
    scaled: &[Lanes],
    inverse_of: &impl Fn(usize) -> Lanes,
    least: &mut Lanes,
) -> Lanes {
    let diagonal = row[i];
    let mut d = diagonal;
    for j in 0..i {
        let l = scaled[j] * inverse_of(j);
        d = (-scaled[j]).mul_add(l, d);
        row[j] = l;
    }
    // With the operands in this order, a NaN passes into the result.
    let share = d / diagonal;
    *least = share.simd_ge(*least).select(*least, share);
    let inverse = Lanes::splat(1.0) / d;
    row[i] = inverse;
    inverse
}

#[cfg(test)]
mod tests {
    use super::{LaneSystems, Lanes, packed_row};
    use crate::geometry::random::CounterRandom;
    use crate::linear_algebra::number::LANES;

    #[test]
    fn solves_a_system_in_each_lane() {
        let random = CounterRandom::new(8);
        for n in [1, 2, 3, 15, 20, 35] {
            // Gram matrices of random rows.
            let entry = |lane: usize, r: usize, c: usize| random.symmetric(&[lane as i64, r as i64, c as i64]);
            let gram = |lane: usize, i: usize, j: usize| -> f64 {
                (0..2 * n).map(|r| entry(lane, r, i) * entry(lane, r, j)).sum()
            };
            let mut systems = LaneSystems::default();
            systems.reset(n);
            for i in 0..n {
                for j in 0..=i {
                    systems.matrix_mut()[packed_row(i) + j] = Lanes::new(std::array::from_fn(|l| gram(l, i, j)));
                }
            }
            let least = systems.factorize().to_array();
            assert!(least.iter().all(|s| *s > 1e-6 && *s <= 1.0), "{least:?}");
            let exact = |lane: usize, i: usize| random.symmetric(&[99, lane as i64, i as i64]);
            let mut b: Vec<Lanes> = (0..n)
                .map(|i| {
                    Lanes::new(std::array::from_fn(|l| (0..n).map(|j| gram(l, i.max(j), i.min(j)) * exact(l, j)).sum()))
                })
                .collect();
            systems.solve(&mut b);
            for (i, x) in b.iter().enumerate() {
                for l in 0..LANES {
                    assert!((x.to_array()[l] - exact(l, i)).abs() < 1e-9, "size {n}, lane {l}");
                }
            }
        }
    }

    #[test]
    fn a_rank_deficient_lane_does_not_affect_the_others() {
        let mut systems = LaneSystems::default();
        systems.reset(2);
        let lanes = |first: f64| Lanes::new([first, 2.0, 2.0, 2.0]);
        systems.matrix_mut().copy_from_slice(&[lanes(1.0), lanes(1.0), lanes(1.0)]);
        systems.matrix_mut()[1] = Lanes::new([1.0, 0.5, 0.5, 0.5]);
        let least = systems.factorize().to_array();
        assert_eq!(least[0], 0.0);
        assert!(least[1] > 0.9);
    }
}
