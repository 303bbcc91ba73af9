//! Solvers and integrators of a scene, from their specs.

use super::spec::{SolverChoice, StoppingSpec};
use crate::linear_algebra::krylov::Stopping;
use crate::schemes::surface_equation::{EvolutionIntegrator, Solver};

/// Tolerance where neither it nor Δt is given.
const DEFAULT_TOLERANCE: f64 = 1e-7;

/// An explicit integrator: steps are controlled where a tolerance is given, or where no time step is.
pub(super) fn explicit(tolerance: Option<f64>, time_step: Option<f64>) -> EvolutionIntegrator {
    match (tolerance, time_step) {
        (Some(tolerance), _) => EvolutionIntegrator::Controlled { tolerance },
        (None, None) => EvolutionIntegrator::Controlled { tolerance: DEFAULT_TOLERANCE },
        (None, Some(_)) => EvolutionIntegrator::FixedSteps,
    }
}

impl From<&StoppingSpec> for Stopping {
    fn from(spec: &StoppingSpec) -> Self {
        Self { tolerance: spec.tolerance, max_iterations: spec.max_iterations }
    }
}

/// The solver of a choice.
pub(super) fn solver(choice: &SolverChoice) -> Solver {
    match choice {
        SolverChoice::Auto { stopping } => Solver::Automatic(stopping.into()),
        SolverChoice::Cg { stopping } => Solver::Cg(stopping.into()),
        SolverChoice::Bicgstab { stopping } => Solver::BiCgStab(stopping.into()),
        SolverChoice::Gmres { restart, stopping } => Solver::Gmres { restart: *restart, stopping: stopping.into() },
        SolverChoice::SparseLu => Solver::SparseLu,
    }
}
