//! Rates of density and velocity in the mass form: continuity with diffusion (PCP eq. B.12, corrected by errata), pressure
//! with a viscosity that stands for the physical one (B.13, B.14).

use super::pair_sums::{Columns, TINY, total};
use crate::linear_algebra::number::{Lanes, Number};
use crate::neighbors::Pencils;
use crate::parallel::{Interrupt, Interrupted};
use crate::smoothing_kernels::RadialKernel;
use std::array::from_fn;

/// μ̂ of B.14, in ε².
const SOFTENING: f64 = 0.01;

/// What is found for a particle, but for the factors that are the same for all pairs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rates<const D: usize> {
    /// Σ m_j (P_i/ρ_i² + P_j/ρ_j² + Π_ij) ∇W, by m h-units and the kernel's factor.
    pub force: [f64; D],
    /// Σ u_ij·∇W V_j, likewise.
    pub compression: f64,
    /// Σ 2 (ρ_i − ρ_j) W'/r V_j, likewise.
    pub diffusion: f64,
}

impl<const D: usize> Default for Rates<D> {
    fn default() -> Self {
        Self { force: [0.0; D], compression: 0.0, diffusion: 0.0 }
    }
}

/// The sums of B.12 and B.13.
///
/// Columns: position in ε, velocity; ρ, V in h^D, P/ρ²; and where the fluids differ also mass by that of the inner fluid, k ν, 1/ρ₀.
/// `viscosity` is k ν of one fluid for both, k = 8 in the plane and 10 in space.
pub(super) fn sum_rates<K: RadialKernel, const D: usize, const S: usize>(
    pencils: &Pencils<D>,
    columns: &Columns<'_, D, 2, S>,
    inverse_smoothing: f64,
    viscosity: f64,
    rates: &mut [Rates<D>],
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    let zero = Lanes::splat(0.0);
    let softening = Lanes::splat(SOFTENING);
    // Π = −k ν u·x/(ε ρ̄ (q² + μ̂)), with ρ̄ = (ρ_i + ρ_j)/2.
    let drag = Lanes::splat(-2.0 * inverse_smoothing);
    let same = Lanes::splat(viscosity);
    pencils.for_each_place(rates, interrupt, |place, near, rates| {
        let own = columns.at(place);
        let u = own.vectors[1];
        let (density, stress) = (own.scalars[0], own.scalars[2]);
        let (mut force, mut compression, mut diffusion) = ([zero; D], zero, zero);
        columns.pairs(&own, near, inverse_smoothing, |dx, square, other| {
            let slope: Lanes = K::slope_over_q(Number::sqrt(square));
            let [other_density, volume] = [other.scalars[0], other.scalars[1]];
            let approach = {
                let parts: [Lanes; D] = from_fn(|d| (u[d] - other.vectors[1][d]) * dx[d]);
                parts.into_iter().reduce(|a, b| a + b).unwrap_or(zero)
            };
            let (mut kinematic, mut mass) = (same, Lanes::splat(1.0));
            let mut excess = density - other_density;
            if let (Some(m), Some(a), Some(b), Some(by), Some(other_by)) = (
                other.scalars.get(3),
                own.scalars.get(4),
                other.scalars.get(4),
                own.scalars.get(5),
                other.scalars.get(5),
            ) {
                mass = *m;
                kinematic = (*a + *a) * *b / (*a + *b + Lanes::splat(TINY));
                excess = density * *by - other_density * *other_by;
            }
            let viscous = drag * kinematic * approach / ((density + other_density) * (square + softening));
            let weight = slope * mass * (stress + other.scalars[2] + viscous);
            for d in 0..D {
                force[d] = Number::mul_add(weight, dx[d], force[d]);
            }
            let spread = slope * volume;
            compression = Number::mul_add(spread, approach, compression);
            diffusion = Number::mul_add(spread, excess + excess, diffusion);
        });
        *rates = Rates { force: force.map(total), compression: total(compression), diffusion: total(diffusion) };
    })
}
