//! Interactions: the terms of the equations of motion, one item each, with its formula and its source.
//!
//! | interaction | acts on | file |
//! | --- | --- | --- |
//! | summation of densities | pairs | [`density_summation`] |
//! | compression, diffusion of density | pairs | [`continuity`] |
//! | pressure, volume form and mass form | pairs | [`pressure`] |
//! | viscosity, volume form and mass form | pairs | [`viscosity`] |
//! | shifting | pairs | [`shifting`] |
//! | surface tension | particles | [`surface_tension`] |
//! | contact lines at walls | particles | [`contact_line`] |
//! | body force | particles | [`body_force`] |
//!
//! Terms on pairs are combined at compile time into a form of the momentum equation: a tuple of [`PairTerm`]s is a term again.
//! Forces on particles ([`ParticleForce`]) are combined once a run into a list. An interaction that limits the time step says
//! so itself ([`LimitsStep`]).

pub mod body_force;
pub mod contact_line;
pub mod continuity;
pub mod density_summation;
pub mod mass_pair;
pub mod pressure;
pub mod shifting;
pub mod surface_tension;
pub mod viscosity;
pub mod volume_pair;

pub use body_force::{BodyForce, FormulaForce};
pub use surface_tension::TensionForce;

use super::droplets::Droplets;
use super::flow_state::FlowState;
use super::fluids::Fluid;
use super::interface::Interface;
use super::varying_tension::TensionField;
use crate::closest_point::SurfaceColumns;
use crate::geometry::Vector;
use crate::particles::Particles;

/// A term of a sum over pairs. `P` is the pair as the form of the equation sees it, `B` what the terms add up to.
pub(super) trait PairTerm<P, B>: Copy + Sync {
    /// Adds the share of this term.
    fn add_to(self, sum: B, pair: &P) -> B;

    /// Whether the term adds nothing to any pair.
    #[inline(always)]
    fn is_none(self) -> bool {
        false
    }
}

/// The sum of no terms.
#[derive(Debug, Clone, Copy)]
pub(super) struct NoTerm;

impl<P, B> PairTerm<P, B> for NoTerm {
    #[inline(always)]
    fn add_to(self, sum: B, _pair: &P) -> B {
        sum
    }

    #[inline(always)]
    fn is_none(self) -> bool {
        true
    }
}

impl<P, B, First: PairTerm<P, B>, Second: PairTerm<P, B>> PairTerm<P, B> for (First, Second) {
    #[inline(always)]
    fn add_to(self, sum: B, pair: &P) -> B {
        self.1.add_to(self.0.add_to(sum, pair), pair)
    }
}

/// What a force on particles may depend on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment<'a, const D: usize> {
    /// Time of the evaluation.
    pub time: f64,
    /// Positions, and what particles know of the interface.
    pub particles: &'a Particles<D>,
    /// The columns of the interface.
    pub columns: &'a SurfaceColumns,
    pub flow: &'a FlowState<D>,
    pub interface: &'a Interface<D>,
    pub droplets: &'a Droplets<D>,
    /// The surface tension, where it is not the same everywhere.
    pub tension: Option<&'a TensionField<D>>,
}

/// A force on each particle by itself.
pub(super) trait ParticleForce<const D: usize>: Send + Sync {
    /// Adds the accelerations of this force.
    fn add_to(&self, acceleration: &mut [Vector<D>], moment: &Moment<'_, D>);
}

/// A longest stable time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepLimit {
    /// The longest step.
    pub length: f64,
    /// What binds it, for messages.
    pub cause: &'static str,
}

/// What a limit of the time step depends on.
#[derive(Debug, Clone, Copy)]
pub struct LimitContext {
    /// The smoothing length ε.
    pub smoothing_length: f64,
    /// The largest speed of a particle.
    pub speed: f64,
    /// The viscosity of which the excess acts along pairs; infinite where none does.
    pub least_viscosity: f64,
    /// Factors of the limits.
    pub numbers: StabilityNumbers,
}

/// The factors of the stability limits, which depend on integrator and discretization.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StabilityNumbers {
    /// Of ε/(c + u).
    pub acoustic: f64,
    /// Of ρ ε²/η.
    pub viscous: f64,
    /// Of √(ρ ε³/(2π τ)).
    pub capillary: f64,
    /// Of √(ε/a).
    pub body_force: f64,
}

/// An interaction that limits the time step.
pub(super) trait LimitsStep {
    /// The limit for particles of a fluid.
    fn step_limit(&self, fluid: &Fluid, context: &LimitContext) -> StepLimit;
}
