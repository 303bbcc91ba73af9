//! Pressure and viscous forces between particles in the volume form (PCP eq. B.2): antisymmetric in the pair, so that
//! momentum is kept to round-off.

use super::column::Column;
use super::pair_sums::{Columns, TINY};
use crate::linear_algebra::number::{Lanes, Number};
use crate::neighbors::Pencils;
use crate::parallel::{Interrupt, Interrupted};
use crate::smoothing_kernels::RadialKernel;
use std::array::from_fn;

/// The force on each particle, −Σ (V_i² + V_j²) P̄ ∇W + Σ η (V_i² + V_j²) u_ij/r ∂W/∂r, by the factor of the first sum.
///
/// P̄ = (V_i P_i + V_j P_j)/(V_i + V_j): for particles of one mass that is the paper's (ρ_i P_j + ρ_j P_i)/(ρ_i + ρ_j). Of two masses the
/// paper's mean takes the pressure of the lighter side; a drop in a fluid of a tenth of its density flew apart with it and
/// holds with this one (measured). Volumes are those of a lattice up to compression, so the quotient is a series in
/// 1 − (V_i + V_j)/2, exact to its eighth power.
/// Columns: position in ε, η u/ε; V in h^D, V P in h^D. Where viscosities differ: u/ε, and η behind the others.
pub(super) fn sum_forces<K: RadialKernel, const D: usize, const S: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 2, S>,
    inverse_smoothing: f64,
    forces: &mut [Column],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    let (one, half) = (Lanes::splat(1.0), Lanes::splat(-0.5));
    columns.sum_pairs(pencils, inverse_smoothing, forces, interrupt, |own, other, dx, square| {
        let slope: Lanes = K::slope_over_q(Number::sqrt(square));
        let (volume, stress) = (own.scalars[0], own.scalars[1]);
        let (other_volume, other_stress) = (other.scalars[0], other.scalars[1]);
        let common = slope * Number::mul_add(other_volume, other_volume, volume * volume);
        let sum = (stress + other_stress) * half;
        let mut across: [Lanes; D] = from_fn(|d| own.vectors[1][d] - other.vectors[1][d]);
        if let ([_, _, a], [_, _, b]) = (&own.scalars[..], &other.scalars[..]) {
            // The harmonic mean keeps the shear stress of two layers.
            let viscosity = (*a + *a) * *b / (*a + *b + Lanes::splat(TINY));
            across = across.map(|c| c * viscosity);
        }
        let e = Number::mul_add(volume + other_volume, half, one);
        let e2 = e * e;
        let first = Number::mul_add(sum, e, sum);
        let second = Number::mul_add(first, e2, first);
        let mean = Number::mul_add(second, e2 * e2, second);
        let force: [Lanes; D] = from_fn(|d| common * Number::mul_add(mean, dx[d], across[d]));
        (force, force.map(|part| -part))
    })
}
