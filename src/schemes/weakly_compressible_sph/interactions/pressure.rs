//! The pressure between particles.

use super::mass_pair::{self, MassPair};
use super::{LimitContext, LimitsStep, PairTerm, StepLimit, volume_pair};
use crate::linear_algebra::number::{Lanes, Number};
use crate::schemes::weakly_compressible_sph::fluids::Fluid;
use crate::schemes::weakly_compressible_sph::pair_sums::Pair;
use std::array::from_fn;

/// Pressure in the volume form, −P̄ x_ij with P̄ = (V_i P_i + V_j P_j)/(V_i + V_j) (PCP eq. B.2, first term).
///
/// For particles of one mass P̄ is the paper's (ρ_i P_j + ρ_j P_i)/(ρ_i + ρ_j). For two masses the paper's mean takes the
/// pressure of the lighter side: with it a drop in a fluid of a tenth of its density flew apart, with this mean it holds
/// (measured). Volumes are those of a lattice up to compression, so the quotient is computed as a series in
/// 1 − (V_i + V_j)/2, exact to its eighth power.
#[derive(Debug, Clone, Copy)]
pub struct VolumePressure;

impl<const D: usize, const S: usize> PairTerm<Pair<'_, D, 2, S>, [Lanes; D]> for VolumePressure {
    #[inline(always)]
    fn add_to(self, sum: [Lanes; D], pair: &Pair<'_, D, 2, S>) -> [Lanes; D] {
        let ((volume, other_volume), (stress, other_stress)) =
            (pair.scalar(volume_pair::VOLUME), pair.scalar(volume_pair::STRESS));
        let half = Lanes::splat(-0.5);
        let mean = (stress + other_stress) * half;
        let e = Number::mul_add(volume + other_volume, half, Lanes::splat(1.0));
        let e2 = e * e;
        let first = Number::mul_add(mean, e, mean);
        let second = Number::mul_add(first, e2, first);
        let quotient = Number::mul_add(second, e2 * e2, second);
        from_fn(|d| Number::mul_add(quotient, pair.dx[d], sum[d]))
    }
}

/// Pressure in the volume form, −(P_i V_i² + P_j V_j²)/a x_ij: minus the gradient of the elastic energy. Stresses are gathered
/// as P V²/a in units of the cell.
#[derive(Debug, Clone, Copy)]
pub struct HamiltonianPressure;

impl<const D: usize, const S: usize> PairTerm<Pair<'_, D, 2, S>, [Lanes; D]> for HamiltonianPressure {
    #[inline(always)]
    fn add_to(self, sum: [Lanes; D], pair: &Pair<'_, D, 2, S>) -> [Lanes; D] {
        let (stress, other_stress) = pair.scalar(volume_pair::STRESS);
        let both = -(stress + other_stress);
        from_fn(|d| Number::mul_add(both, pair.dx[d], sum[d]))
    }
}

/// Pressure in the mass form, P_i/ρ_i² + P_j/ρ_j² (PCP eq. B.13).
#[derive(Debug, Clone, Copy)]
pub struct MassPressure;

impl<const D: usize, const S: usize> PairTerm<MassPair<'_, D, S>, Lanes> for MassPressure {
    #[inline(always)]
    fn add_to(self, sum: Lanes, pair: &MassPair<'_, D, S>) -> Lanes {
        let (stress, other_stress) = pair.sides.scalar(mass_pair::STRESS);
        sum + (stress + other_stress)
    }
}

/// The limit of sound waves, which every form of the pressure carries: a factor of ε/(c + u) (PCP eq. B.11).
#[derive(Debug, Clone, Copy)]
pub struct SoundWaves;

impl LimitsStep for SoundWaves {
    fn step_limit(&self, fluid: &Fluid, context: &LimitContext) -> StepLimit {
        let length = context.numbers.acoustic * context.smoothing_length / (fluid.sound_speed + context.speed);
        StepLimit { length, cause: "the speed of sound" }
    }
}
