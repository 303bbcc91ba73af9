//! What an evolution on a surface is made of.

use super::diffusivity::Diffusivity;
use super::formula_field::{FormulaField, Sites};
use super::reactions::{Reaction, Terms};
use super::solver::Solver;
use std::borrow::Cow;
use std::sync::Arc;

/// What is made or taken at every point of a surface.
#[derive(Debug, Clone)]
pub enum Source {
    /// A formula of place and time.
    Formula {
        /// The rate.
        field: Arc<FormulaField>,
        /// The points.
        sites: Sites,
    },
    /// A rate at every point that stays.
    Values(Vec<f64>),
}

impl Source {
    /// The rates at a time.
    ///
    /// # Errors
    /// The formula and the first point where it has no value.
    pub(super) fn rates(&self, time: f64) -> Result<Cow<'_, [f64]>, String> {
        match self {
            Self::Formula { field, sites } => field.values(sites, time).map(Cow::Owned),
            Self::Values(rates) => Ok(Cow::Borrowed(rates)),
        }
    }
}

/// How time is integrated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EvolutionIntegrator {
    /// Dormand and Prince's pair, one step of it a step.
    FixedSteps,
    /// The same, as many steps as keep the error of each below a tolerance.
    Controlled {
        /// Root mean square of the error by 1 + |u|.
        tolerance: f64,
    },
    /// (3 u⁺ − 4 u + u⁻)/2Δt = Δ_S u⁺, begun with a backward Euler step.
    Bdf2(Solver),
}

/// What is known exactly of a course.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ExactCourse {
    /// No exact course is known.
    Unknown,
    /// The initial field times exp(−λ t): it is an eigenfunction.
    Decay(f64),
    /// The manufactured solution of the reaction.
    Manufactured,
}

/// Fields, reaction and integrator of an evolution.
#[derive(Debug, Clone)]
pub struct EvolutionParts {
    /// The substances, one after another.
    pub initial: Vec<f64>,
    /// Reaction of the substances; without one it is diffusion alone.
    pub reaction: Option<Reaction>,
    /// Diffusivity of each substance; a reaction multiplies by its own where it is uniform.
    pub diffusivities: Vec<Diffusivity>,
    /// What is made at every point, without a reaction.
    pub source: Option<Source>,
    /// Δt of the implicit formula.
    pub time_step: f64,
    /// Integrator of time.
    pub integrator: EvolutionIntegrator,
    /// The exact course, where it is known.
    pub exact: ExactCourse,
}

impl EvolutionParts {
    /// Diffusion alone: nothing makes or takes the substance.
    pub(super) fn is_plain(&self) -> bool {
        self.reaction.is_none() && self.source.is_none()
    }

    /// Why formulas have no value where the substances have these values, if they have none.
    pub(super) fn undefined(&self, values: &[f64], time: f64) -> Option<String> {
        if let Some(source) = &self.source {
            return source.rates(time).err();
        }
        match &self.reaction.as_ref()?.terms {
            Terms::Formulas(terms) => terms.fault(values, time),
            Terms::Model(_) => None,
        }
    }
}
