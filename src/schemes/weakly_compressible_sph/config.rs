//! The configuration of a run: choices as values.

use super::interactions::surface_tension::SurfaceTension;
use super::interactions::{BodyForce, TensionForce};
use super::interface::level_set;
use super::kernel_choice::KernelChoice;
use super::level_update::LevelUpdate;
use super::mean_shear::MeanShear;
use super::species::Fluids;
use super::standing_wave::StandingWave;
use super::steady_flow::SteadyFlow;
use super::tension_law::TensionLaw;
use super::walls::Container;
use crate::closest_point::PcpMethod;
use crate::geometry::Vector;
use crate::operators::Support;

/// Form of the pressure force between particles with densities by summation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PressureForm {
    /// (V_i² + V_j²) P̄ with the mean P̄ of PCP eq. B.2.
    Mean,
    /// P_i V_i² + P_j V_j²: minus the gradient of the elastic energy, so that pressure creates no energy.
    Hamiltonian,
}

/// How volumes follow from sums of kernels, V_i = a/Σ_j W_ij.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Volumes {
    /// a = 1 (PCP eq. B.1). A lattice at rest then has a small pressure.
    Plain,
    /// a such that the volumes of the start fill the box. A lattice at rest has no pressure.
    Calibrated,
}

/// How pressures act between particles with densities by summation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PressureConfig {
    /// Form of the pair force.
    pub form: PressureForm,
    /// Volumes of particles.
    pub volumes: Volumes,
    /// Background pressure p_b in τκ₀, with the curvature κ₀ of the smallest droplet at the start.
    pub background: f64,
    /// Bulk damping β: the pressure −β ρ c ε (∇·u) that opposes compression.
    pub bulk_damping: f64,
}

impl PressureConfig {
    /// The pressures of the PCP paper (eqs. B.1 and B.2).
    pub const PAPER: Self =
        Self { form: PressureForm::Mean, volumes: Volumes::Plain, background: 0.0, bulk_damping: 0.0 };
}

/// Distance in spacings h that the neighbor lists reach beyond the kernel's support. A wider skin means longer loops over
/// pairs, a thinner one lists that are made more often.
const SKIN_H: f64 = 0.3;

/// Where normals and curvatures of the interface come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Geometry {
    /// Particle closest points in a band around the interface.
    Pcp {
        /// The closest-point method.
        method: PcpMethod,
        /// Half the width of the band.
        half_band: f64,
        /// What becomes of the level that particles carry.
        level_update: LevelUpdate,
        /// Radius of the surface filter of the curvature; None for curvatures as fitted.
        curvature_filter: Option<f64>,
    },
    /// The smoothed color of the species (PCP eqs. B.5 to B.10).
    ColorField,
}

/// How densities are found, and with them the form of the pressure force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DensityMethod {
    /// Summation (PCP eq. B.1) with the volume form of the forces (B.2).
    Summation,
    /// The continuity equation with diffusion (B.12) and the mass form of the forces (B.13, B.14).
    Continuity {
        /// Coefficient ξ̂ of the diffusion, without dimension.
        diffusion: f64,
    },
}

/// How the derivatives of the flow are discretized.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Discretization {
    /// Sums over kernels.
    Kernels,
    /// Polynomial fits around every particle (DC-PSE); densities by continuity.
    Dcpse(Support),
}

/// The time integrator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Integrator {
    /// Kick, drift, kick with a predicted velocity for viscosity: one evaluation a step.
    KickDriftKick,
    /// Half a step ahead, then the whole step with the rates found there (the paper's): two evaluations a step.
    PredictorCorrector,
}

/// The configuration of a run, its particles aside.
#[derive(Debug, Clone, PartialEq)]
pub struct SphConfig<const D: usize> {
    /// Distance h of neighboring particles at the start.
    pub spacing: f64,
    /// Smoothing length ε.
    pub smoothing_length: f64,
    /// Smoothing kernel W.
    pub kernel: KernelChoice,
    /// The fluid of each species.
    pub fluids: Fluids,
    /// Surface tension τ; with 0 no interface is computed.
    pub tension: f64,
    /// Form of the surface tension's force.
    pub tension_force: TensionForce,
    /// What the tension depends on, where it is not the same everywhere.
    pub tension_law: Option<TensionLaw<D>>,
    /// Method for normals and curvatures.
    pub geometry: Geometry,
    /// Method for the derivatives of the flow.
    pub discretization: Discretization,
    /// Method for densities.
    pub density: DensityMethod,
    /// Pressures, where densities are summed.
    pub pressure: PressureConfig,
    /// Whether particles are shifted towards an even distribution (PCP eqs. B.15, B.16).
    pub is_shifted: bool,
    /// Displacement of a shift by ε² ∇C; .05 in the paper.
    pub shifting_rate: f64,
    /// The mean shear of a box whose images slide past each other.
    pub mean_shear: Option<MeanShear>,
    /// The walls; None in a box that is periodic along every axis.
    pub container: Option<Container<D>>,
    /// Whether the fluids are flat layers at the start.
    pub starts_in_layers: bool,
    /// The steady flow that layers between walls come to.
    pub steady_flow: Option<SteadyFlow<D>>,
    /// A background pressure that keeps the pressures of fluids which rest on walls positive.
    pub hydrostatic_pressure: f64,
    /// A force from outside.
    pub body_force: Option<BodyForce<D>>,
    /// The time integrator.
    pub integrator: Integrator,
    /// Velocity of both fluids at the start.
    pub start_velocity: Vector<D>,
    /// Whether the fluids do not move about that velocity at the start.
    pub is_at_rest: bool,
    /// The standing wave that a layer starts with.
    pub wave: Option<StandingWave>,
    /// The speed that the longest step is chosen for; faster particles cut steps into parts.
    pub expected_speed: f64,
    /// Whether a step beyond the stability limits is cut into parts; false where the user gave the time step.
    pub is_adaptive: bool,
    /// The run ends when all particles are slower than this speed.
    pub rest_below: Option<f64>,
}

impl<const D: usize> SphConfig<D> {
    /// Neighbors are listed anew when a particle has moved by half of this length.
    #[must_use]
    pub fn skin(&self) -> f64 {
        SKIN_H * self.spacing
    }

    /// Distance up to which particles are listed as neighbors.
    #[must_use]
    pub fn cutoff(&self) -> f64 {
        self.kernel.support() * self.smoothing_length + self.skin()
    }

    /// Thickness of the layers of points behind walls: beyond it no particle reaches through the layers of two walls, for its neighbors
    /// and for an interface that is continued behind one of them.
    #[must_use]
    pub fn layer_thickness(&self) -> f64 {
        match &self.geometry {
            Geometry::Pcp { method, half_band, .. } if self.has_tension() => {
                self.cutoff().max(level_set::reach::<D>(method, *half_band, self.spacing))
            }
            Geometry::Pcp { .. } | Geometry::ColorField => self.cutoff(),
        }
    }

    /// The time ½ √(ρh³/(2πτ)) of capillary waves as long as the spacing, in which a carried level is repaired by its share.
    /// ρ is the mean density of the two fluids.
    #[must_use]
    pub fn repair_time(&self) -> f64 {
        let density = 0.5 * (self.fluids.inside.density + self.fluids.outside.density);
        0.5 * (density * self.spacing.powi(3) / (2.0 * std::f64::consts::PI * self.tension)).sqrt()
    }

    /// Whether viscosity is the divergence of the whole stress η (∇u + ∇uᵀ), not of η∇u, which is the same with one viscosity and in flat
    /// layers that slide along themselves. The paper's form has η∇u.
    #[must_use]
    pub fn has_whole_stress(&self) -> bool {
        self.discretization == Discretization::Kernels
            && !self.is_density_integrated()
            && self.pressure.form == PressureForm::Hamiltonian
            && !self.fluids.have_one_viscosity()
            && !self.starts_in_layers
    }

    /// Whether there is an interface to compute.
    #[must_use]
    pub fn has_tension(&self) -> bool {
        self.tension != 0.0
    }

    /// The interaction of surface tension; its coefficient is 0 where there is no interface to compute.
    pub(super) fn surface_tension(&self) -> SurfaceTension {
        let is_overwritten =
            !matches!(self.geometry, Geometry::Pcp { level_update: LevelUpdate::Transparent { .. }, .. });
        SurfaceTension::new(self.tension, self.tension_force, self.smoothing_length, is_overwritten)
    }

    /// Whether densities are integrated in time, not found anew at every evaluation.
    #[must_use]
    pub fn is_density_integrated(&self) -> bool {
        self.density != DensityMethod::Summation
    }
}
