//! Density by summation (PCP eq. B.1): how many particles there are to a unit of volume.

use super::column::Column;
use super::pair_sums::Columns;
use crate::linear_algebra::number::Number;
use crate::neighbors::Pencils;
use crate::parallel::{Interrupt, Interrupted};
use crate::smoothing_kernels::RadialKernel;

/// Σ_j w(q_ij) over the others: with w(0), times σ/ε^D, it is the number density, 1/V_i.
pub(super) fn sum_kernel<K: RadialKernel, const D: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 1, 0>,
    inverse_smoothing: f64,
    sums: &mut [Column],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    columns.sum_pairs(pencils, inverse_smoothing, sums, interrupt, |_, _, _, square| {
        let value = K::value(Number::sqrt(square));
        ([value], [value])
    })
}
