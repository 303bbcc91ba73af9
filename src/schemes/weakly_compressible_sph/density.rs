//! Density by summation (PCP eq. B.1): how many particles there are to a unit of volume.

use super::pair_sums::{Columns, total};
use crate::linear_algebra::number::{Lanes, Number};
use crate::neighbors::Pencils;
use crate::parallel::{Interrupt, Interrupted};
use crate::smoothing_kernels::RadialKernel;

/// Σ_j w(q_ij), the particle itself included: times σ/ε^D it is the number density, 1/V_i.
pub(super) fn sum_kernel<K: RadialKernel, const D: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 1, 0>,
    inverse_smoothing: f64,
    sums: &mut [f64],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    pencils.for_each_place(sums, interrupt, |place, near, sum| {
        let own = columns.at(place);
        let mut lanes = Lanes::splat(0.0);
        columns.pairs(&own, near, inverse_smoothing, |_, square, _| {
            lanes += K::value(Number::sqrt(square));
        });
        *sum = total(lanes);
    })
}
