//! Ritz values of Arnoldi's method: estimates of the eigenvalues with the largest real parts.

use super::{LinearMap, add, dot, norm};
use crate::geometry::random::CounterRandom;
use nalgebra::DMatrix;

/// Seed of the first vector.
const SEED: u64 = 0x7269_747a;
/// Iterations of the small eigenvalue problem at most.
const SMALL_ITERATIONS: usize = 10_000;

/// The largest real part of the Ritz values after so many steps from a random vector.
///
/// An eigenvalue that lies beyond the others is approached from within the field of values. NaN where the map gives no numbers, or
/// where the small problem does not converge. The first vector depends on the size alone.
#[must_use]
pub fn largest_real_part(map: &dyn LinearMap, steps: usize) -> f64 {
    let n = map.size();
    let random = CounterRandom::new(SEED);
    let mut first: Vec<f64> = (0..n).map(|i| random.symmetric(&[i as i64])).collect();
    let length = norm(&first);
    first.iter_mut().for_each(|value| *value /= length);
    let mut basis = vec![first];
    let mut small = DMatrix::<f64>::zeros(steps, steps);
    let mut size = 0;
    for k in 0..steps.min(n) {
        let mut next = vec![0.0; n];
        map.apply(&basis[k], &mut next);
        // Twice, since once loses digits.
        for _ in 0..2 {
            for (row, vector) in basis.iter().enumerate() {
                let part = dot(vector, &next);
                small[(row, k)] += part;
                add(&mut next, -part, vector);
            }
        }
        size = k + 1;
        let length = norm(&next);
        if !length.is_finite() || map.is_interrupted() {
            return f64::NAN;
        }
        if length <= 1e-14 * small.column(k).norm() || size == steps {
            break;
        }
        small[(k + 1, k)] = length;
        next.iter_mut().for_each(|value| *value /= length);
        basis.push(next);
    }
    let small = small.view((0, 0), (size, size)).into_owned();
    match nalgebra::Schur::try_new(small, f64::EPSILON, SMALL_ITERATIONS) {
        Some(schur) => schur.complex_eigenvalues().iter().map(|value| value.re).fold(f64::NEG_INFINITY, f64::max),
        None => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::largest_real_part;
    use crate::linear_algebra::SparseRows;

    /// Second differences on a ring with one row whose sign is wrong: the mode that grows is found.
    #[test]
    fn a_growing_mode_is_found_and_none_is_made_up() {
        let ring = |wrong: Option<usize>| {
            let mut rows = SparseRows::default();
            let n = 400;
            for i in 0..n {
                let sign = if Some(i) == wrong { -1.0 } else { 1.0 };
                let columns = [((i + n - 1) % n) as u32, i as u32, ((i + 1) % n) as u32];
                rows.push_row(&columns, &[sign, -2.0 * sign, sign]);
            }
            rows
        };
        assert!(largest_real_part(&ring(None), 60).abs() < 0.05);
        let found = largest_real_part(&ring(Some(17)), 60);
        // The mode 3^−|i − 17| has the eigenvalue 4/3.
        assert!((found - 4.0 / 3.0).abs() < 1e-3, "{found}");
    }
}
