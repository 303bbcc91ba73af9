//! Viscosity between particles.

use super::mass_pair::{self, MassPair};
use super::{LimitContext, LimitsStep, PairTerm, StepLimit, volume_pair};
use crate::linear_algebra::number::{Lanes, Number};
use crate::schemes::weakly_compressible_sph::fluids::Fluid;
use crate::schemes::weakly_compressible_sph::pair_sums::{Pair, harmonic_mean};
use std::array::from_fn;

/// Viscosity in the volume form for one viscosity of all pairs, η u_ij (PCP eq. B.2, second term). Velocities are gathered
/// times η.
#[derive(Debug, Clone, Copy)]
pub struct UniformViscosity;

impl<const D: usize, const S: usize> PairTerm<Pair<'_, D, 2, S>, [Lanes; D]> for UniformViscosity {
    #[inline(always)]
    fn add_to(self, sum: [Lanes; D], pair: &Pair<'_, D, 2, S>) -> [Lanes; D] {
        let stress = pair.difference(volume_pair::VELOCITY);
        from_fn(|d| sum[d] + stress[d])
    }
}

/// Viscosity in the volume form for a viscosity of each species, η_ij u_ij (PCP eq. B.2, second term). The harmonic mean
/// η_ij = 2 η_i η_j/(η_i + η_j) keeps the shear stress of two layers.
#[derive(Debug, Clone, Copy)]
pub struct SpeciesViscosity;

impl<const D: usize, const S: usize> PairTerm<Pair<'_, D, 2, S>, [Lanes; D]> for SpeciesViscosity {
    #[inline(always)]
    fn add_to(self, sum: [Lanes; D], pair: &Pair<'_, D, 2, S>) -> [Lanes; D] {
        let viscosity = harmonic_mean(pair.scalar(volume_pair::VISCOSITY));
        let velocity = pair.difference(volume_pair::VELOCITY);
        from_fn(|d| sum[d] + velocity[d] * viscosity)
    }
}

/// Viscosity in the volume form as the divergence of the whole stress η (∇u + ∇uᵀ), η₀ u_ij + (D + 2)(η_ij − η₀)(u_ij·e) e with the
/// direction e of the pair and the smaller viscosity η₀.
///
/// Where viscosity jumps, ∇·(η∇u) alone leaves out the stress of an interface that is stretched or turned: the waves on two layers, one ten
/// times as viscous, then come to a wrong answer (docs/results/wall-notes.md). Forces along the pair have all of it (Violeau 2009); with one
/// viscosity both are the same, and u_ij is the more exact of them where particles are sheared into rows.
#[derive(Debug, Clone, Copy)]
pub struct StressViscosity {
    /// η₀.
    pub least: f64,
}

impl<const D: usize, const S: usize> PairTerm<Pair<'_, D, 2, S>, [Lanes; D]> for StressViscosity {
    #[inline(always)]
    fn add_to(self, sum: [Lanes; D], pair: &Pair<'_, D, 2, S>) -> [Lanes; D] {
        let least = Lanes::splat(self.least);
        let excess = harmonic_mean(pair.scalar(volume_pair::VISCOSITY)) - least;
        let velocity = pair.difference(volume_pair::VELOCITY);
        let parts = velocity.iter().zip(pair.dx).skip(1);
        let approach = parts.fold(velocity[0] * pair.dx[0], |sum, (u, x)| Number::mul_add(*u, *x, sum));
        // A particle has no direction to itself.
        let square = pair.square + Lanes::splat(f64::MIN_POSITIVE);
        let along = excess * approach * Lanes::splat((D + 2) as f64) / square;
        from_fn(|d| Number::mul_add(pair.dx[d], along, Number::mul_add(velocity[d], least, sum[d])))
    }
}

/// Viscosity in the mass form, Π_ij = −k ν_ij u_ij·x_ij/(ρ̄_ij (r² + μ̂ ε²)) with ρ̄_ij = (ρ_i + ρ_j)/2 (PCP eq. B.14). It
/// stands for the physical viscosity, so it acts on approaching and on parting pairs (errata, PCP B.13).
#[derive(Debug, Clone, Copy)]
pub struct MonaghanViscosity {
    drag: f64,
}

/// The number μ̂ of B.14, which keeps Π finite where two particles meet (the paper's).
const SOFTENING: f64 = 0.01;

impl MonaghanViscosity {
    /// The factor k that makes Π stand for a kinematic viscosity in `dimension` dimensions.
    #[must_use]
    pub fn factor(dimension: usize) -> f64 {
        if dimension == 2 { 8.0 } else { 10.0 }
    }

    /// The term for pairs with separations in units of ε.
    #[must_use]
    pub fn new(inverse_smoothing: f64) -> Self {
        Self { drag: -2.0 * inverse_smoothing }
    }
}

impl<const D: usize, const S: usize> PairTerm<MassPair<'_, D, S>, Lanes> for MonaghanViscosity {
    #[inline(always)]
    fn add_to(self, sum: Lanes, pair: &MassPair<'_, D, S>) -> Lanes {
        let (density, other_density) = pair.sides.scalar(mass_pair::DENSITY);
        let softened = pair.sides.square + Lanes::splat(SOFTENING);
        sum + Lanes::splat(self.drag) * pair.constants.viscosity * pair.approach
            / ((density + other_density) * softened)
    }
}

/// The limit of viscous diffusion: a factor of ρ ε²/η.
#[derive(Debug, Clone, Copy)]
pub struct ViscousDiffusion;

impl LimitsStep for ViscousDiffusion {
    fn step_limit(&self, fluid: &Fluid, context: &LimitContext) -> StepLimit {
        let epsilon = context.smoothing_length;
        // Forces along pairs are three times as stiff against compression.
        let stiff = fluid.viscosity + 2.0 * (fluid.viscosity - context.least_viscosity).max(0.0);
        let length = context.numbers.viscous * fluid.density * epsilon * epsilon / stiff;
        StepLimit { length, cause: "viscosity" }
    }
}
