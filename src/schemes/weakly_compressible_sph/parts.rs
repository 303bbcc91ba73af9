//! What a run is made of: choices as values.

use super::body_force::BodyForce;
use super::fluids::Fluid;
use super::kernel_choice::KernelChoice;
use crate::closest_point::PcpMethod;
use crate::operators::Support;

/// The skin in h.
const SKIN_H: f64 = 0.3;

/// Where normals and curvatures come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Geometry {
    /// Particle closest points in a band of half width `half_band`.
    Pcp {
        /// The method.
        method: PcpMethod,
        /// w/2.
        half_band: f64,
    },
    /// The smoothed colour of the phases (PCP eqs. B.5 to B.10).
    ColorField,
}

/// The force of surface tension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TensionForce {
    /// −(τ/ρ) (κ − κ₀) n δ with one κ₀ a droplet, whose part is a gradient and belongs to the pressure.
    Balanced,
    /// −(τ/ρ) κ n δ (PCP eq. B.4).
    Csf,
}

/// Where densities come from, and with them the form of the pressure force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DensityMethod {
    /// Summation (B.1), volume form (B.2).
    Summation,
    /// Continuity with diffusion (B.12), mass form (B.13, B.14).
    Continuity {
        /// ξ̂.
        diffusion: f64,
    },
}

/// How the flow is discretized.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Discretization {
    /// Sums over kernels.
    Kernels,
    /// Fits about every particle; densities by continuity.
    Dcpse(Support),
}

/// How steps are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Integrator {
    /// Kick, drift, kick with a predicted velocity for viscosity: one evaluation a step.
    KickDriftKick,
    /// Half a step ahead, then the whole with what is found there: two evaluations a step (the paper's).
    PredictorCorrector,
}

/// What a run is made of, beside its particles.
#[derive(Debug, Clone, PartialEq)]
pub struct SphParts<const D: usize> {
    /// h.
    pub spacing: f64,
    /// ε.
    pub smoothing_length: f64,
    /// W.
    pub kernel: KernelChoice,
    /// Inside, outside.
    pub inside: Fluid,
    /// The other.
    pub outside: Fluid,
    /// τ; with 0 no interface is computed.
    pub tension: f64,
    /// Its force.
    pub tension_force: TensionForce,
    /// Normals and curvatures.
    pub geometry: Geometry,
    /// The flow.
    pub discretization: Discretization,
    /// Densities.
    pub density: DensityMethod,
    /// Whether particles are shifted towards evenness (B.15, B.16).
    pub is_shifted: bool,
    /// From outside.
    pub body_force: Option<BodyForce<D>>,
    /// Steps.
    pub integrator: Integrator,
    /// Whether steps that the limits forbid are cut into parts; not where a time step was given.
    pub is_adaptive: bool,
    /// The run ends when nobody is faster.
    pub rest_below: Option<f64>,
}

impl<const D: usize> SphParts<D> {
    /// The fluid of a phase.
    #[must_use]
    pub fn fluid(&self, is_inside: bool) -> &Fluid {
        if is_inside { &self.inside } else { &self.outside }
    }

    /// Whether all particles have one mass.
    #[must_use]
    pub fn has_one_mass(&self) -> bool {
        self.inside.density == self.outside.density
    }

    /// Whether all pairs have one dynamic viscosity.
    #[must_use]
    pub fn has_one_viscosity(&self) -> bool {
        self.inside.viscosity == self.outside.viscosity
    }

    /// Neighbours are listed anew when somebody has moved by half of it.
    #[must_use]
    pub fn skin(&self) -> f64 {
        SKIN_H * self.spacing
    }

    /// How far from each other particles are listed as neighbours.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.kernel.support() * self.smoothing_length + self.skin()
    }

    /// Whether there is an interface to compute.
    #[must_use]
    pub fn has_tension(&self) -> bool {
        self.tension != 0.0
    }
}
