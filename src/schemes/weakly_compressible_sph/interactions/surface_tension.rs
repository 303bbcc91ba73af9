//! Surface tension as a force on the particles next to the interface (PCP eqs. B.3, B.4, B.10).

use super::{LimitContext, LimitsStep, Moment, ParticleForce, StepLimit};
use crate::geometry::Vector;
use crate::schemes::weakly_compressible_sph::droplets::Droplets;
use crate::schemes::weakly_compressible_sph::fluids::Fluid;
use crate::schemes::weakly_compressible_sph::interface::Interface;
use crate::schemes::weakly_compressible_sph::species::Species;
use std::f64::consts::PI;

/// The force of surface tension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TensionForce {
    /// −(τ/ρ) (κ − κ₀) n δ with one curvature κ₀ a droplet, without the sum over each droplet. The part of κ₀ is a gradient
    /// and belongs to the pressure. On a closed surface the integrals of κ n and of n vanish, but their sums over particles
    /// do not; in a periodic box nothing slows what they set in motion.
    Balanced,
    /// −(τ/ρ) (κ − κ₀) n δ with one curvature κ₀ a droplet, as version 0.1 had it: the sum over a droplet is not zero.
    BalancedUncorrected,
    /// −(τ/ρ) κ n δ, the continuum surface force (PCP eq. B.4).
    Csf,
}

impl TensionForce {
    /// The curvature κ₀ whose force the pressure has absorbed, at a particle.
    fn absorbed_curvature<const D: usize>(self, droplets: &Droplets<D>, i: usize) -> f64 {
        match self {
            Self::Balanced | Self::BalancedUncorrected => droplets.ball_curvature(i),
            Self::Csf => 0.0,
        }
    }
}

/// Share of δ_{ε/2} in the δ of the balanced force, the rest is δ_ε. A force that is spread over the width ε acts on the
/// interface like ∫ e^{−k|φ|} δ dφ at the wave number k, and generates vorticity as wide: both lower frequency and decay. With
/// more of the narrow δ the decay of resolved drops comes out too high (measured; docs/results/droplet-notes.md).
const NARROW_SHARE: f64 = 0.25;

/// The same where the level is overwritten: drops that divide lose or gain more area with more of it.
const NARROW_SHARE_OVERWRITTEN: f64 = 0.15;

/// Surface tension: −(τ/ρ) (κ − κ₀) n δ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceTension {
    /// The coefficient τ.
    coefficient: f64,
    force: TensionForce,
    /// The width ε of the smoothed δ.
    smoothing_length: f64,
    /// Share of δ_{ε/2} in it.
    narrow_share: f64,
}

impl SurfaceTension {
    /// The force for a coefficient τ, with a δ of the width ε. `is_overwritten` says whether closest points replace the level.
    #[must_use]
    pub fn new(coefficient: f64, force: TensionForce, smoothing_length: f64, is_overwritten: bool) -> Self {
        let narrow_share = match force {
            TensionForce::Balanced if is_overwritten => NARROW_SHARE_OVERWRITTEN,
            TensionForce::Balanced => NARROW_SHARE,
            TensionForce::BalancedUncorrected | TensionForce::Csf => 0.0,
        };
        Self { coefficient, force, smoothing_length, narrow_share }
    }

    /// The δ of the force at a signed distance.
    pub fn profile(&self, distance: f64) -> f64 {
        let wide = smoothed_delta(distance, self.smoothing_length);
        if self.narrow_share == 0.0 {
            return wide;
        }
        self.narrow_share * smoothed_delta(distance, 0.5 * self.smoothing_length) + (1.0 - self.narrow_share) * wide
    }

    /// The part τ κ₀ of the pressure that the balanced force has absorbed, at a particle: 0 outside the droplets.
    pub fn absorbed_pressure<const D: usize>(&self, species: Species, droplets: &Droplets<D>, i: usize) -> f64 {
        if species == Species::Inside { self.coefficient * self.force.absorbed_curvature(droplets, i) } else { 0.0 }
    }
}

/// Accelerations by surface tension of the particles in a band.
#[derive(Debug, Default)]
pub struct BandForces<const D: usize> {
    /// Particles and their accelerations.
    pub forces: Vec<(usize, Vector<D>)>,
    /// Sum of the forces and of the shares V δ of each droplet; storage.
    sums: Vec<(Vector<D>, f64)>,
}

impl SurfaceTension {
    /// Finds the accelerations of the particles in the band of a level set.
    pub fn find_band_forces<const D: usize>(&self, band: &mut BandForces<D>, moment: &Moment<'_, D>) {
        let BandForces { forces, sums } = band;
        forces.clear();
        let Interface::LevelSet(level_set) = moment.interface else { return };
        let (particles, columns) = (moment.particles, moment.columns);
        let (phi, curvature) = (particles.scalar(columns.phi), particles.scalar(columns.curvature));
        let (normal, band) = (particles.vector(columns.normal), particles.flag(columns.in_band));
        for i in level_set.candidates().iter().copied().filter(|i| band[*i] == 1) {
            let delta = self.profile(phi[i]);
            if delta > 0.0 {
                forces.push((i, normal[i] * (self.strength(i, curvature[i], moment) * delta)));
            }
        }
        if self.force == TensionForce::Balanced {
            self.remove_net_force(forces, sums, moment);
        }
    }

    /// The acceleration −τ/ρ (κ − κ₀) by δ.
    fn strength<const D: usize>(&self, i: usize, curvature: f64, moment: &Moment<'_, D>) -> f64 {
        let absorbed = self.force.absorbed_curvature(moment.droplets, i);
        -self.coefficient / moment.flow.density[i] * (curvature - absorbed)
    }

    /// Takes the sum over each droplet out of the forces: f_i ← f_i − F V_i δ_i/(D m_i) with F = Σ m f and D = Σ V δ.
    fn remove_net_force<const D: usize>(
        &self,
        forces: &mut [(usize, Vector<D>)],
        sums: &mut Vec<(Vector<D>, f64)>,
        moment: &Moment<'_, D>,
    ) {
        let (flow, droplets) = (moment.flow, moment.droplets);
        let phi = moment.particles.scalar(moment.columns.phi);
        sums.clear();
        sums.resize(droplets.groups(), (Vector::<D>::zeros(), 0.0));
        for (i, force) in forces.iter() {
            let (net, shares) = &mut sums[droplets.group(*i)];
            *net += force * flow.mass(*i);
            *shares += flow.volume[*i] * self.profile(phi[*i]);
        }
        for (i, force) in forces {
            let (net, shares) = sums[droplets.group(*i)];
            *force -= net * (flow.volume[*i] * self.profile(phi[*i]) / (shares * flow.mass(*i)));
        }
    }
}

/// The force of a color field, where n̂ stands for n δ; the forces of a level set are found by
/// [`SurfaceTension::find_band_forces`].
impl<const D: usize> ParticleForce<D> for SurfaceTension {
    fn add_to(&self, acceleration: &mut [Vector<D>], moment: &Moment<'_, D>) {
        if let Interface::ColorField(color) = moment.interface {
            for (i, gradient) in color.gradient.iter().enumerate() {
                acceleration[i] += gradient * self.strength(i, color.curvature[i], moment);
            }
        }
    }
}

impl LimitsStep for SurfaceTension {
    /// The limit of capillary waves: a factor of √(ρ ε³/(2π τ)).
    fn step_limit(&self, fluid: &Fluid, context: &LimitContext) -> StepLimit {
        let period = (fluid.density * self.smoothing_length.powi(3) / (2.0 * PI * self.coefficient.abs())).sqrt();
        StepLimit { length: context.numbers.capillary * period, cause: "capillary waves" }
    }
}

/// The smoothed δ of a signed distance: Wendland's C² kernel of one dimension (B.3), with the support 2 ε.
pub fn smoothed_delta(distance: f64, smoothing_length: f64) -> f64 {
    let q = distance.abs() / smoothing_length;
    let rest = (1.0 - 0.5 * q).max(0.0);
    0.625 / smoothing_length * rest * rest * rest * (1.5 * q + 1.0)
}

/// The integral of [`smoothed_delta`] up to a signed distance, from 0 to 1.
pub fn smoothed_step(distance: f64, smoothing_length: f64) -> f64 {
    // ∫ (5/4) (1 − t)³ (1 + 3t) dt with t = |d|/(2ε).
    let t = (0.5 * distance.abs() / smoothing_length).min(1.0);
    let half = 1.25 * (t - 2.0 * t.powi(3) + 2.0 * t.powi(4) - 0.6 * t.powi(5));
    0.5 + half.copysign(distance)
}

#[cfg(test)]
mod tests {
    use super::{smoothed_delta, smoothed_step};

    #[test]
    fn the_smoothed_step_is_the_integral_of_delta() {
        for d in [-0.9, -0.5, -0.1, 0.0, 0.2, 0.7, 0.79] {
            let slope = (smoothed_step(d + 1e-5, 0.4) - smoothed_step(d - 1e-5, 0.4)) / 2e-5;
            assert!((slope - smoothed_delta(d, 0.4)).abs() < 1e-4, "{d}");
        }
        assert!((smoothed_step(2.0, 0.4) - 1.0).abs() < 1e-15 && smoothed_step(-2.0, 0.4).abs() < 1e-15);
    }

    #[test]
    fn the_smoothed_delta_integrates_to_one() {
        let sum: f64 = (0..4000).map(|k| smoothed_delta(f64::from(k - 2000) * 1e-3 + 5e-4, 0.4) * 1e-3).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
    }
}
