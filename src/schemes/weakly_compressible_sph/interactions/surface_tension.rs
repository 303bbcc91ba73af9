//! Surface tension as a force on the particles next to the interface (PCP eqs. B.3, B.4, B.10).

use super::{LimitContext, LimitsStep, Moment, ParticleForce, StepLimit};
use crate::geometry::Vector;
use crate::schemes::weakly_compressible_sph::droplets::Droplets;
use crate::schemes::weakly_compressible_sph::fluids::Fluid;
use crate::schemes::weakly_compressible_sph::interface::Interface;
use crate::schemes::weakly_compressible_sph::smoothed_delta::smoothed_delta;
use crate::schemes::weakly_compressible_sph::varying_tension::TensionField;
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
                let force = match moment.tension {
                    None => normal[i] * (self.strength(i, curvature[i], moment) * delta),
                    Some(field) => self.varying_force(field, i, (curvature[i], normal[i]), moment) * delta,
                };
                forces.push((i, force));
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

    /// The acceleration −((τκ − τ̄κ₀) n − ∇τ)/ρ by δ, with the gradient along the interface (Marangoni) and the mean tension τ̄ of
    /// the droplet.
    fn varying_force<const D: usize>(
        &self,
        field: &TensionField<D>,
        i: usize,
        (curvature, normal): (f64, Vector<D>),
        moment: &Moment<'_, D>,
    ) -> Vector<D> {
        if field.tension[i].is_nan() {
            return Vector::<D>::zeros();
        }
        let absorbed = self.absorbed_pressure(moment.droplets, Some(field), i);
        (field.gradient[i] - normal * (field.tension[i] * curvature - absorbed)) / moment.flow.density[i]
    }

    /// The part τ̄κ₀ of the pressure inside that the balanced force has absorbed, of the droplet that a particle belongs to.
    pub fn absorbed_pressure<const D: usize>(
        &self,
        droplets: &Droplets<D>,
        field: Option<&TensionField<D>>,
        i: usize,
    ) -> f64 {
        let mean = field.map_or(self.coefficient, |field| field.means[droplets.group(i)]);
        let kappa = self.force.absorbed_curvature(droplets, i);
        // A group without an interface has no mean, and no curvature.
        if kappa == 0.0 { 0.0 } else { mean * kappa }
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
        // A wall holds a drop that touches it.
        let floats = |i: usize| !droplets.is_at_wall(i);
        for (i, force) in forces.iter().filter(|(i, _)| floats(*i)) {
            let (net, shares) = &mut sums[droplets.group(*i)];
            *net += force * flow.mass(*i);
            *shares += flow.volume[*i] * self.profile(phi[*i]);
        }
        for (i, force) in forces.iter_mut().filter(|(i, _)| floats(*i)) {
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
