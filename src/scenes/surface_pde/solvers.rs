//! Solvers and integrators of a scene, from their specs.

use super::spec::{SolverChoice, StoppingSpec};
use crate::linear_algebra::krylov::Stopping;
use crate::schemes::surface_equation::{EvolutionIntegrator, Solver};
use crate::spec::Violation;
use serde_json::json;

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

/// Refuses conjugate gradients where the system is not symmetric.
pub(super) fn check_cg(
    solver: Option<&SolverChoice>,
    (is_conservative, has_held_points): (bool, bool),
    errors: &mut Vec<Violation>,
) {
    if !matches!(solver, Some(SolverChoice::Cg { .. })) {
        return;
    }
    let detail = if !is_conservative {
        "conjugate gradients need a symmetric system, which only the method `conservative` always has"
    } else if has_held_points {
        "conjugate gradients need a symmetric system, which held points do not leave"
    } else {
        return;
    };
    let allowed = json!(["auto", "bicgstab", "gmres", "sparse_lu"]);
    errors.push(Violation::new("/solver", "conflict", detail, "cg", allowed));
}

#[cfg(test)]
mod tests {
    use crate::scene;
    use serde_json::{Value, json};

    #[test]
    fn cg_is_refused_where_points_hold_their_value() {
        let refused = |condition: &str, solver: &str| {
            let problem = json!({"type": "poisson", "condition": condition});
            let body = json!({"kind": "surface_pde", "method": "conservative", "problem": problem, "solver": solver});
            let errors = scene::parse(&body, crate::scenes::SCENES).err().unwrap_or_default();
            errors.iter().map(|error| (error.pointer.clone(), error.got.clone())).collect::<Vec<_>>()
        };
        assert_eq!(refused("dirichlet", "cg"), [("/solver".to_owned(), Value::from("cg"))]);
        assert_eq!(refused("dirichlet", "auto"), []);
        assert_eq!(refused("zero_mean", "cg"), []);
    }
}
