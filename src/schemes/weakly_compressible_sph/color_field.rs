//! Normals and curvatures of the smoothed colour of the phases (PCP eqs. B.5 to B.10; Adami et al. 2010), with the volume of
//! particle j in the sum of B.6 and curvatures of the sign of this project: positive where the inside is convex.

use super::column::Column;
use super::pair_sums::Columns;
use crate::linear_algebra::number::{Lanes, Number};
use crate::neighbors::Pencils;
use crate::parallel::{Interrupt, Interrupted};
use crate::smoothing_kernels::RadialKernel;

/// |n̂| ε above which a particle is one of the interface (B.7).
pub(super) const THRESHOLD: f64 = 0.01;

/// Σ c_j W V_j (B.5) over the others but for the kernel's factor. Columns: position in ε; V c.
pub(super) fn sum_color<K: RadialKernel, const D: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 1, 1>,
    inverse_smoothing: f64,
    colors: &mut [Column],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    columns.sum_pairs(pencils, inverse_smoothing, colors, interrupt, |own, other, _, square| {
        let value: Lanes = K::value(Number::sqrt(square));
        ([value * other.scalars[0]], [value * own.scalars[0]])
    })
}

/// Σ (c_j − c_i) ∇W V_j (B.6) but for the kernel's factor. Columns: position in ε; c, V in h^D.
pub(super) fn sum_gradient<K: RadialKernel, const D: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 1, 2>,
    inverse_smoothing: f64,
    gradients: &mut [Column],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    columns.sum_pairs(pencils, inverse_smoothing, gradients, interrupt, |own, other, dx, square| {
        let slope: Lanes = K::slope_over_q(Number::sqrt(square));
        // Both the difference and ∇W turn round with the pair.
        let common = slope * (other.scalars[0] - own.scalars[0]);
        (dx.map(|part| common * other.scalars[1] * part), dx.map(|part| common * own.scalars[1] * part))
    })
}

/// The sums of B.9 over the others, Σ N_j W V_j and Σ N_j (n_j − n_i)·∇W V_j, each but for the kernel's factor; nothing where
/// N_i is zero. Columns: position in ε, unit normal; V N in h^D.
pub(super) fn sum_curvature<K: RadialKernel, const D: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 2, 1>,
    inverse_smoothing: f64,
    sums: &mut [Column],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    // Of a pair with a particle away from the interface neither side gets anything that is used.
    let is_met = |place: usize| columns.scalars[0][place] != 0.0;
    columns.sum_pairs_of(pencils, inverse_smoothing, sums, interrupt, is_met, |own, other, dx, square| {
        let q = Number::sqrt(square);
        let (value, slope): (Lanes, Lanes) = (K::value(q), K::slope_over_q(q));
        let mut turn = Lanes::splat(0.0);
        for (d, dx) in dx.iter().enumerate() {
            turn = Number::mul_add(other.vectors[1][d] - own.vectors[1][d], *dx, turn);
        }
        let [mine, others] = [own.scalars[0], other.scalars[0]];
        ([value * others, slope * others * turn], [value * mine, slope * mine * turn])
    })
}
