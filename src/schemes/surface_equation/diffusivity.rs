//! Diffusivities that vary from point to point.

use crate::linear_algebra::SparseRows;

/// How fast a substance diffuses.
#[derive(Debug, Clone, PartialEq)]
pub enum Diffusivity {
    /// As fast everywhere.
    Uniform(f64),
    /// A value d ≥ 0 at every point.
    Varying(Vec<f64>),
}

impl Diffusivity {
    /// The factor of Δ_S where it is the same everywhere; 1 for rows that have it in them ([`Self::rows`]).
    #[must_use]
    pub fn factor(&self) -> f64 {
        match self {
            Self::Uniform(factor) => *factor,
            Self::Varying(_) => 1.0,
        }
    }

    /// Rows of ∇_S·(d ∇_S u) from those of Δ_S, where d varies.
    ///
    /// ∇_S·(d ∇_S u) = ½ [Δ_S (d u) + d Δ_S u − u Δ_S d]. For rows w that give constants 0 this is Σ_j w_ij (d_i + d_j)/2 (u_j − u_i):
    /// it has the order of Δ_S, and what is symmetric in areas stays so.
    pub(super) fn rows(&self, laplacian: &SparseRows) -> Option<SparseRows> {
        let Self::Varying(diffusivity) = self else { return None };
        let mut rows = laplacian.clone();
        rows.change_rows(|i, columns, weights| {
            let mut exchanged = 0.0;
            for (j, weight) in columns.iter().zip(weights.iter_mut()).filter(|(j, _)| **j as usize != i) {
                *weight *= 0.5 * (diffusivity[i] + diffusivity[*j as usize]);
                exchanged += *weight;
            }
            let mut own = -exchanged;
            for (_, weight) in columns.iter().zip(weights.iter_mut()).filter(|(j, _)| **j as usize == i) {
                *weight = std::mem::take(&mut own);
            }
        });
        Some(rows)
    }

    /// The range of values in words, where it varies.
    pub(super) fn range(&self) -> Option<String> {
        let Self::Varying(values) = self else { return None };
        let ends = values.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), value| (a.min(*value), b.max(*value)));
        Some(format!("{:.4e} to {:.4e}", ends.0, ends.1))
    }
}

#[cfg(test)]
mod tests {
    use super::{Diffusivity, SparseRows};

    /// On three points of a line a unit apart, with the flux between two by the mean of their diffusivities.
    #[test]
    fn constants_stay_and_fluxes_are_those_of_both_points() {
        let mut laplacian = SparseRows::default();
        laplacian.push_row(&[0, 1], &[-1.0, 1.0]);
        laplacian.push_row(&[0, 1, 2], &[1.0, -2.0, 1.0]);
        laplacian.push_row(&[], &[]);
        let rows = Diffusivity::Varying(vec![1.0, 3.0, 5.0]).rows(&laplacian).unwrap();
        let mut out = [0.0; 3];
        rows.apply(&[4.0; 3], &mut out);
        assert_eq!(out, [0.0; 3]);
        rows.apply(&[0.0, 1.0, 4.0], &mut out);
        assert_eq!(out, [2.0, 4.0 * 3.0 - 2.0, 0.0]);
        assert!(Diffusivity::Uniform(2.0).rows(&laplacian).is_none());
    }
}
