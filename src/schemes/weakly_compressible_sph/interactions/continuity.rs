//! The continuity equation with diffusion (PCP eq. B.12; errata, PCP B.12).

use super::mass_pair::MassPair;
use crate::linear_algebra::number::Lanes;

/// Compression, dρ_i/dt = ρ_i Σ_j u_ij·∇W V_j: the share of a pair but for ρ_i, the kernel's slope and V_j. The same for both
/// particles.
#[inline(always)]
pub fn compression<const D: usize, const S: usize>(pair: &MassPair<'_, D, S>) -> Lanes {
    pair.approach
}

/// Diffusion of density, dρ_i/dt = ξ̂ ε c Σ_j 2 (ρ_i − ρ_j) x_ij·∇W/r² V_j: the share of a pair but for ξ̂ ε c, the kernel's
/// slope and V_j. Opposite for the two particles.
///
/// The densities of two fluids are compared in units of their reference densities.
#[inline(always)]
pub fn diffusion<const D: usize, const S: usize>(pair: &MassPair<'_, D, S>) -> Lanes {
    pair.constants.excess + pair.constants.excess
}
