//! Rates of density and velocity in the mass form: continuity with diffusion (PCP eq. B.12, corrected in docs/errata.md), pressure
//! with a viscosity that stands for the physical one (B.13, B.14).

use super::column::Column;
use super::pair_sums::{Columns, Side, TINY};
use crate::linear_algebra::number::{Lanes, Number};
use crate::neighbors::Pencils;
use crate::parallel::{Interrupt, Interrupted};
use crate::smoothing_kernels::RadialKernel;
use std::array::from_fn;

/// μ̂ of B.14, in ε².
const SOFTENING: f64 = 0.01;

/// Sums of a particle: D parts of force, compression, diffusion.
pub(super) const fn sums_of(dimension: usize) -> usize {
    dimension + 2
}

/// The sums of B.12 and B.13, but for factors that are the same for all pairs: Σ m_j (P_i/ρ_i² + P_j/ρ_j² + Π_ij) ∇W,
/// Σ u_ij·∇W V_j and Σ 2 (ρ_i − ρ_j) W'/r V_j. N = D + 2.
///
/// Columns: position in ε, velocity; ρ, V in h^D, P/ρ²; and where the fluids differ also mass by that of the inner fluid, k ν, 1/ρ₀.
/// `viscosity` is k ν of one fluid for both, k = 8 in the plane and 10 in space.
pub(super) fn sum_rates<K: RadialKernel, const D: usize, const S: usize, const N: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 2, S>,
    inverse_smoothing: f64,
    viscosity: f64,
    rates: &mut [Column],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    let (zero, one, softening) = (Lanes::splat(0.0), Lanes::splat(1.0), Lanes::splat(SOFTENING));
    // Π = −k ν u·x/(ε ρ̄ (q² + μ̂)), with ρ̄ = (ρ_i + ρ_j)/2.
    let drag = Lanes::splat(-2.0 * inverse_smoothing);
    let same = Lanes::splat(viscosity);
    columns.sum_pairs(pencils, inverse_smoothing, rates, interrupt, |own, other, dx, square| {
        let slope: Lanes = K::slope_over_q(Number::sqrt(square));
        let ([density, volume, stress], [other_density, other_volume, other_stress]) = (first(own), first(other));
        let mut approach = zero;
        for (d, part) in dx.iter().enumerate() {
            approach = Number::mul_add(own.vectors[1][d] - other.vectors[1][d], *part, approach);
        }
        let (mut kinematic, mut mass, mut other_mass) = (same, one, one);
        let mut excess = density - other_density;
        if let (&[_, _, _, m, a, by], &[_, _, _, other_m, b, other_by]) = (&own.scalars[..], &other.scalars[..]) {
            (mass, other_mass) = (m, other_m);
            kinematic = (a + a) * b / (a + b + Lanes::splat(TINY));
            excess = density * by - other_density * other_by;
        }
        let viscous = drag * kinematic * approach / ((density + other_density) * (square + softening));
        let force = slope * (stress + other_stress + viscous);
        let (compression, diffusion) = (slope * approach, slope * (excess + excess));
        // Force and diffusion change their sign with the side, compression does not.
        let parts = |mass: Lanes, volume: Lanes, sign: Lanes| -> [Lanes; N] {
            let (weight, spread) = (sign * mass * force, sign * volume * diffusion);
            from_fn(|n| dx.get(n).map_or(if n == D { volume * compression } else { spread }, |part| weight * *part))
        };
        (parts(other_mass, other_volume, one), parts(mass, volume, -one))
    })
}

fn first<const D: usize, const S: usize>(side: &Side<D, 2, S>) -> [Lanes; 3] {
    from_fn(|s| side.scalars.get(s).copied().unwrap_or(Lanes::splat(0.0)))
}
