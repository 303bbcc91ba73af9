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
    /// −(τ/ρ) (κ − κ₀) n δ with one curvature κ₀ a droplet. The part of κ₀ is a gradient and belongs to the pressure.
    Balanced,
    /// −(τ/ρ) κ n δ, the continuum surface force (PCP eq. B.4).
    Csf,
}

impl TensionForce {
    /// The curvature κ₀ whose force the pressure has absorbed, at a particle.
    fn absorbed_curvature<const D: usize>(self, droplets: &Droplets<D>, i: usize) -> f64 {
        match self {
            Self::Balanced => droplets.ball_curvature(i),
            Self::Csf => 0.0,
        }
    }
}

/// Surface tension: −(τ/ρ) (κ − κ₀) n δ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceTension {
    /// The coefficient τ.
    coefficient: f64,
    force: TensionForce,
    /// The width ε of the smoothed δ.
    smoothing_length: f64,
}

impl SurfaceTension {
    /// The force for a coefficient τ, with a δ of the width ε.
    #[must_use]
    pub fn new(coefficient: f64, force: TensionForce, smoothing_length: f64) -> Self {
        Self { coefficient, force, smoothing_length }
    }

    /// The part τ κ₀ of the pressure that the balanced force has absorbed, at a particle: 0 outside the droplets.
    pub fn absorbed_pressure<const D: usize>(&self, species: Species, droplets: &Droplets<D>, i: usize) -> f64 {
        if species == Species::Inside { self.coefficient * self.force.absorbed_curvature(droplets, i) } else { 0.0 }
    }
}

impl<const D: usize> ParticleForce<D> for SurfaceTension {
    /// The interface's curvature, normal and δ are those of the closest points, or those of the color field, where n̂ stands
    /// for n δ.
    fn add_to(&self, acceleration: &mut [Vector<D>], moment: &Moment<'_, D>) {
        let density = &moment.flow.density;
        let strength = |i: usize, curvature: f64| {
            let absorbed = self.force.absorbed_curvature(moment.droplets, i);
            -self.coefficient / density[i] * (curvature - absorbed)
        };
        match moment.interface {
            Interface::Absent => {}
            Interface::LevelSet(level_set) => {
                let (particles, columns) = (moment.particles, moment.columns);
                let (phi, curvature) = (particles.scalar(columns.phi), particles.scalar(columns.curvature));
                let (normal, band) = (particles.vector(columns.normal), particles.flag(columns.in_band));
                for i in level_set.candidates().iter().copied().filter(|i| band[*i] == 1) {
                    let delta = smoothed_delta(phi[i], self.smoothing_length);
                    if delta > 0.0 {
                        acceleration[i] += normal[i] * (strength(i, curvature[i]) * delta);
                    }
                }
            }
            Interface::ColorField(color) => {
                for (i, gradient) in color.gradient.iter().enumerate() {
                    acceleration[i] += gradient * strength(i, color.curvature[i]);
                }
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
fn smoothed_delta(distance: f64, smoothing_length: f64) -> f64 {
    let q = distance.abs() / smoothing_length;
    let rest = (1.0 - 0.5 * q).max(0.0);
    0.625 / smoothing_length * rest * rest * rest * (1.5 * q + 1.0)
}

#[cfg(test)]
mod tests {
    use super::smoothed_delta;

    #[test]
    fn the_smoothed_delta_integrates_to_one() {
        let sum: f64 = (0..4000).map(|k| smoothed_delta(f64::from(k - 2000) * 1e-3 + 5e-4, 0.4) * 1e-3).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
    }
}
