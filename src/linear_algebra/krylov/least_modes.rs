//! The eigenvalues of an operator that are nearest to zero, by block Krylov spaces of its shifted inverse (Grimes 1994).
//!
//! A Krylov space of a few vectors finds only so many copies of a repeated eigenvalue. So what was found is locked, and a new
//! space begins with other vectors orthogonal to it, until that finds nothing that is missing.

use super::{LinearMap, add, dot, norm};
use crate::geometry::random::CounterRandom;
use crate::parallel::Interrupt;
use faer::Mat;
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};

/// Seed of the first vectors.
const SEED: u64 = 0x6d6f_6465;
/// Vectors of a block.
const BLOCK: usize = 8;
/// Residual of the inverse, by its eigenvalue, at which a mode counts as found in the first space. Later ones are orthogonal to
/// modes that are no more exact than that, and get less far.
const TOLERANCE: f64 = 1e-10;
const LATER_TOLERANCE: f64 = 1e-8;
/// A vector that orthogonalization leaves less of is one of the space.
const TINY: f64 = 1e-12;
/// Vectors of a space at most: this many a wanted mode, and some.
const MOST: (usize, usize) = (6, 200);
/// An eigenvalue of a later space that is greater by this share is one that the earlier ones missed.
const GREATER: f64 = 1e-8;

/// An operator A with eigenvalues λ of −A, and the inverse of s − A.
pub struct ShiftedInverse<'a> {
    /// A.
    pub map: &'a dyn LinearMap,
    /// Replaces b by the solution of (s − A) x = b.
    pub solve: &'a dyn Fn(&mut [f64]),
    /// s, of the size of the least eigenvalues.
    pub shift: f64,
    /// Weights of the inner product, in which A is symmetric if it is.
    pub weights: &'a [f64],
    /// Whether A is symmetric in the inner product.
    pub is_symmetric: bool,
    /// Unknowns that are zero in every mode; empty where there are none.
    pub is_zero: &'a [bool],
}

/// An eigenvalue of −A with its mode.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// λ, or its real part.
    pub value: f64,
    /// The imaginary part of λ. Two modes with opposite ones span the plane of an eigenvector and its conjugate.
    pub imaginary: f64,
    /// The eigenvector u with Σ w u² = 1 and a positive largest entry.
    pub vector: Vec<f64>,
    /// ‖A u + λ u‖ by ‖u‖, of a complex eigenvector as it is.
    pub residual: f64,
}

/// The eigenvalues were not found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotFound {
    /// The spaces became too large.
    #[error("{vectors} vectors leave eigenvalues that have not converged")]
    TooSlow {
        /// Number of vectors.
        vectors: usize,
    },
    /// The operator gave no numbers, or the small problem has no solution.
    #[error("the operator gives numbers that are none")]
    NoNumbers,
    /// The search was abandoned.
    #[error("the search was interrupted")]
    Interrupted,
}

/// An eigenvalue of the inverse on a space, with its vector in the basis of the space.
struct Pair {
    /// Real part of θ = 1/(λ + s).
    real: f64,
    imaginary: f64,
    coordinates: Vec<f64>,
    /// Imaginary part of the vector; None of a real one.
    partner: Option<Vec<f64>>,
}

impl ShiftedInverse<'_> {
    /// The modes of the `count` eigenvalues with the least |λ + s|, in ascending order of λ.
    ///
    /// # Errors
    /// [`NotFound`].
    pub fn least_modes(&self, count: usize, interrupt: &Interrupt) -> Result<Vec<Mode>, NotFound> {
        let free = self.map.size() - self.is_zero.iter().filter(|is_zero| **is_zero).count();
        let count = count.min(free);
        if count == 0 {
            return Ok(Vec::new());
        }
        let (mut found, mut sizes): (Vec<Vec<f64>>, Vec<f64>) = (Vec::new(), Vec::new());
        for number in 0.. {
            let wanted = if number == 0 { count } else { 1 };
            let new = self.space(&found, wanted.min(free - found.len()), number, interrupt)?;
            sizes.sort_by(|a, b| b.total_cmp(a));
            let least = sizes.get(count - 1).copied().unwrap_or(0.0);
            let is_complete = number > 0 && new.iter().all(|(size, _)| *size <= least * (1.0 + GREATER));
            for (size, mut vector) in new {
                let (_, length) = orthogonalize(&mut vector, &[&found]);
                if length > TINY {
                    vector.iter_mut().for_each(|value| *value /= length);
                    found.push(vector);
                    sizes.push(size);
                }
            }
            if is_complete || found.len() >= free {
                break;
            }
        }
        self.modes(&found, count, interrupt)
    }

    /// Replaces x by W^½ (s − A)⁻¹ W^−½ x: orthogonal in this scaling means orthogonal in the inner product.
    fn apply(&self, x: &mut [f64]) {
        x.iter_mut().zip(self.weights).for_each(|(x, w)| *x /= w.sqrt());
        (self.solve)(x);
        x.iter_mut().zip(self.weights).for_each(|(x, w)| *x *= w.sqrt());
    }

    /// The first vectors of a space.
    fn first(&self, known: &[Vec<f64>], number: i64) -> Vec<Vec<f64>> {
        let (random, n) = (CounterRandom::new(SEED), self.map.size());
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for k in 0..BLOCK {
            let mut x: Vec<f64> = (0..n).map(|i| random.symmetric(&[number, k as i64, i as i64])).collect();
            x.iter_mut().zip(self.is_zero).filter(|(_, is_zero)| **is_zero).for_each(|(x, _)| *x = 0.0);
            let before = norm(&x);
            let (_, length) = orthogonalize(&mut x, &[known, &basis]);
            if length > TINY * before {
                x.iter_mut().for_each(|x| *x /= length);
                basis.push(x);
            }
        }
        basis
    }

    /// What converged first in a space orthogonal to known vectors, so many at least: sizes of eigenvalues of the inverse, and
    /// vectors that span an invariant space with the known ones.
    fn space(
        &self,
        known: &[Vec<f64>],
        wanted: usize,
        number: i64,
        interrupt: &Interrupt,
    ) -> Result<Vec<(f64, Vec<f64>)>, NotFound> {
        let tolerance = if number == 0 { TOLERANCE } else { LATER_TOLERANCE };
        let mut basis = self.first(known, number);
        // The inverse of each vector in coordinates of the basis.
        let mut columns: Vec<Vec<f64>> = Vec::new();
        // The small problem takes longer than the space grows, so that it is not looked at after every block.
        let mut next_look = wanted;
        loop {
            for k in columns.len()..basis.len() {
                if interrupt.is_raised() {
                    return Err(NotFound::Interrupted);
                }
                let mut next = basis[k].clone();
                self.apply(&mut next);
                let before = norm(&next);
                let (mut coordinates, length) = orthogonalize(&mut next, &[known, &basis]);
                if !length.is_finite() {
                    return Err(NotFound::NoNumbers);
                }
                if length > TINY * before {
                    next.iter_mut().for_each(|value| *value /= length);
                    basis.push(next);
                    coordinates.push(length);
                }
                columns.push(coordinates);
            }
            if columns.len() < next_look.min(basis.len()) && columns.len() < basis.len() {
                continue;
            }
            next_look = columns.len() + columns.len() / 10;
            let pairs = self.pairs(&columns)?;
            // What the space leaves of a pair lies along vectors that the inverse was not applied to yet.
            let rest = |pair: &Pair| {
                let along = |row: usize, y: &[f64]| {
                    columns.iter().zip(y).map(|(column, y)| column.get(row).map_or(0.0, |c| c * y)).sum::<f64>()
                };
                let of = |y: &[f64]| (columns.len()..basis.len()).map(|row| along(row, y).powi(2)).sum::<f64>();
                (of(&pair.coordinates) + pair.partner.as_deref().map_or(0.0, of)).sqrt()
            };
            let size = |pair: &Pair| pair.real.hypot(pair.imaginary);
            let ready = pairs.iter().take_while(|pair| rest(pair) <= tolerance * size(pair)).count();
            if ready >= wanted || columns.len() == basis.len() {
                let vector = |pair: &Pair| (size(pair), combined(&basis, &pair.coordinates));
                return Ok(pairs[..ready].iter().map(vector).collect());
            }
            if columns.len() > MOST.0 * wanted + MOST.1 {
                return Err(NotFound::TooSlow { vectors: columns.len() });
            }
        }
    }

    /// Eigenvalues of the inverse on a space, the largest first. Columns have the coordinates of inverses of the basis.
    fn pairs(&self, columns: &[Vec<f64>]) -> Result<Vec<Pair>, NotFound> {
        let m = columns.len();
        let entry = |i: usize, j: usize| columns[j].get(i).copied().unwrap_or(0.0);
        let mut pairs: Vec<Pair> = if self.is_symmetric {
            let small = Mat::from_fn(m, m, |i, j| 0.5 * (entry(i, j) + entry(j, i)));
            let found = small.self_adjoint_eigen(faer::Side::Lower).map_err(|_| NotFound::NoNumbers)?;
            let coordinates = |k: usize| (0..m).map(|i| found.U()[(i, k)]).collect();
            (0..m)
                .map(|k| Pair {
                    real: found.S().column_vector()[k],
                    imaginary: 0.0,
                    coordinates: coordinates(k),
                    partner: None,
                })
                .collect()
        } else {
            let found = Mat::from_fn(m, m, entry).eigen().map_err(|_| NotFound::NoNumbers)?;
            let pair = |k: usize| {
                let value = found.S().column_vector()[k];
                let part = |of: fn(faer::c64) -> f64| (0..m).map(|i| of(found.U()[(i, k)])).collect::<Vec<f64>>();
                let (real, imaginary) = (part(|entry| entry.re), part(|entry| entry.im));
                // Of two conjugate vectors one stands for the real part, the other for the imaginary part.
                let (mut coordinates, mut partner) = (real, (value.im != 0.0).then_some(imaginary));
                if let Some(partner) = partner.as_mut().filter(|_| value.im < 0.0) {
                    // −i u is an eigenvector, too.
                    std::mem::swap(&mut coordinates, partner);
                    partner.iter_mut().for_each(|c| *c = -*c);
                }
                Pair { real: value.re, imaginary: value.im, coordinates, partner }
            };
            (0..m).map(pair).collect()
        };
        pairs.sort_by(|a, b| b.real.hypot(b.imaginary).total_cmp(&a.real.hypot(a.imaginary)));
        Ok(pairs)
    }

    /// The modes on an invariant space.
    fn modes(&self, space: &[Vec<f64>], count: usize, interrupt: &Interrupt) -> Result<Vec<Mode>, NotFound> {
        let mut columns = Vec::new();
        for vector in space {
            if interrupt.is_raised() {
                return Err(NotFound::Interrupted);
            }
            let mut next = vector.clone();
            self.apply(&mut next);
            columns.push(orthogonalize(&mut next, &[space]).0);
        }
        let pairs = self.pairs(&columns)?;
        let found = pairs.iter().take(count).map(|pair| {
            let partner = pair.partner.as_ref().map(|partner| combined(space, partner));
            self.mode(pair, &combined(space, &pair.coordinates), partner.as_deref())
        });
        let mut modes = found.collect::<Result<Vec<Mode>, NotFound>>()?;
        modes.sort_by(|a, b| a.value.total_cmp(&b.value).then(b.imaginary.total_cmp(&a.imaginary)));
        Ok(modes)
    }

    /// A mode from its vectors in the scaling of [`Self::apply`].
    fn mode(&self, pair: &Pair, vector: &[f64], partner: Option<&[f64]>) -> Result<Mode, NotFound> {
        // λ = 1/θ − s.
        let square = pair.real.powi(2) + pair.imaginary.powi(2);
        let (value, imaginary) = (pair.real / square - self.shift, -pair.imaginary / square);
        let unscaled = |v: &[f64]| v.iter().zip(self.weights).map(|(x, w)| x / w.sqrt()).collect::<Vec<f64>>();
        let (mut x, y) = (unscaled(vector), partner.map(unscaled));
        let applied = |v: &[f64]| {
            let mut applied = vec![0.0; v.len()];
            self.map.apply(v, &mut applied);
            applied
        };
        let square_of = |v: &mut dyn Iterator<Item = f64>| v.zip(self.weights).map(|(v, w)| w * v * v).sum::<f64>();
        let mut rest = square_of(
            &mut applied(&x)
                .iter()
                .enumerate()
                .map(|(i, a)| a + value * x[i] - y.as_ref().map_or(0.0, |y| imaginary * y[i])),
        );
        let mut size = square_of(&mut x.iter().copied());
        if let Some(y) = &y {
            rest += square_of(&mut applied(y).iter().enumerate().map(|(i, a)| a + value * y[i] + imaginary * x[i]));
            size += square_of(&mut y.iter().copied());
        }
        let residual = (rest / size).sqrt();
        if !residual.is_finite() {
            return Err(NotFound::NoNumbers);
        }
        let largest = x.iter().fold(0.0_f64, |most, x| if x.abs() > most.abs() { *x } else { most });
        let length = square_of(&mut x.iter().copied()).sqrt().copysign(largest);
        x.iter_mut().for_each(|x| *x /= length);
        Ok(Mode { value, imaginary, vector: x, residual })
    }
}

/// Takes the parts along orthonormal vectors out of x. Returns the parts along those of the last list, and the length of the rest.
fn orthogonalize(x: &mut [f64], lists: &[&[Vec<f64>]]) -> (Vec<f64>, f64) {
    let mut parts = Vec::new();
    for (k, list) in lists.iter().enumerate() {
        let mut along = vec![0.0; list.len()];
        // Twice, since once loses digits.
        for _ in 0..2 {
            let found: Vec<f64> = list.par_iter().map(|vector| dot(vector, x)).collect();
            for ((part, along), vector) in found.iter().zip(&mut along).zip(list.iter()) {
                add(x, -part, vector);
                *along += part;
            }
        }
        if k + 1 == lists.len() {
            parts = along;
        }
    }
    (parts, norm(x))
}

/// Σ c_k v_k.
fn combined(vectors: &[Vec<f64>], coordinates: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; vectors.first().map_or(0, Vec::len)];
    vectors.iter().zip(coordinates).for_each(|(vector, c)| add(&mut sum, *c, vector));
    sum
}

#[cfg(test)]
mod tests {
    use super::{NotFound, ShiftedInverse};
    use crate::linear_algebra::SparseRows;
    use crate::linear_algebra::sparse_lu::SparseLu;
    use crate::parallel::Interrupt;

    /// Advection and diffusion on rings of n points without exchange.
    fn rings(count: usize, n: usize, drift: f64) -> SparseRows {
        let mut rows = SparseRows::default();
        for i in 0..count * n {
            let base = i / n * n;
            let near = [base + (i + n - 1) % n, i, base + (i + 1) % n];
            rows.push_row(&near.map(|j| j as u32), &[1.0 + drift, -2.0, 1.0 - drift]);
        }
        rows
    }

    fn find(rows: &SparseRows, is_symmetric: bool, count: usize) -> Result<Vec<super::Mode>, NotFound> {
        let shift = 0.01;
        let mut shifted = rows.clone();
        shifted.change_rows(|i, columns, weights| {
            for (j, w) in columns.iter().zip(weights) {
                *w = f64::from(u8::from(*j as usize == i)) * shift - *w;
            }
        });
        let factors = SparseLu::from_rows(&shifted, None).unwrap();
        let solve = |x: &mut [f64]| {
            let b = x.to_vec();
            factors.solve(&b, x);
        };
        let weights = vec![2.0; rows.rows()];
        let problem = ShiftedInverse { map: rows, solve: &solve, shift, weights: &weights, is_symmetric, is_zero: &[] };
        problem.least_modes(count, &Interrupt::default())
    }

    /// Twenty equal rings: each eigenvalue is there twenty or forty times, more often than a block has vectors.
    #[test]
    fn repeated_eigenvalues_are_all_found() {
        let n = 20;
        let modes = find(&rings(20, n, 0.0), true, 70).unwrap();
        assert_eq!(modes.len(), 70);
        let exact = |m: usize| 2.0 - 2.0 * (std::f64::consts::TAU * m as f64 / n as f64).cos();
        for (k, mode) in modes.iter().enumerate() {
            let m = if k < 20 {
                0
            } else if k < 60 {
                1
            } else {
                2
            };
            assert!((mode.value - exact(m)).abs() < 1e-9, "{k}: {} for {}", mode.value, exact(m));
            assert!(mode.residual < 1e-7, "{k}: {}", mode.residual);
            let length: f64 = mode.vector.iter().map(|x| 2.0 * x * x).sum();
            assert!((length - 1.0).abs() < 1e-10);
        }
    }

    /// With advection they are complex: (2 − 2 cos φ) ± 2 d i sin φ.
    #[test]
    fn complex_eigenvalues_come_in_pairs() {
        let (n, drift) = (40, 0.05);
        let modes = find(&rings(1, n, drift), false, 5).unwrap();
        assert_eq!(modes.len(), 5);
        for (k, mode) in modes.iter().enumerate() {
            let phi = std::f64::consts::TAU * k.div_ceil(2) as f64 / n as f64;
            assert!((mode.value - (2.0 - 2.0 * phi.cos())).abs() < 1e-9, "{k}: {}", mode.value);
            assert!((mode.imaginary.abs() - 2.0 * drift * phi.sin()).abs() < 1e-9, "{k}: {}", mode.imaginary);
            assert!(mode.residual < 1e-7, "{k}: {}", mode.residual);
        }
    }

    #[test]
    fn all_modes_of_a_small_operator_are_found() {
        assert_eq!(find(&rings(1, 6, 0.0), true, 100).unwrap().len(), 6);
    }
}
