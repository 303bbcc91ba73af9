//! How the sparse systems of problems are solved: factors once, then solutions.

use crate::linear_algebra::SparseRows;
use crate::linear_algebra::krylov::{Convergence, IncompleteFactors, LinearMap, Stopping, bicgstab, gmres};
use crate::linear_algebra::sparse_lu::SparseLu;

/// How sparse systems are solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Solver {
    /// BiCGSTAB with ILU(0).
    BiCgStab(Stopping),
    /// GMRES, begun anew so often, with ILU(0).
    Gmres {
        /// Vectors of the basis before a restart.
        restart: usize,
        /// Tolerance and largest number of iterations.
        stopping: Stopping,
    },
    /// Sparse LU decomposition.
    SparseLu,
}

/// Factors of a system.
#[derive(Debug)]
pub(super) enum Factors {
    Incomplete(IncompleteFactors),
    Complete(Box<SparseLu>),
}

/// Vectors of solutions, to be used again.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    bicgstab: bicgstab::Workspace,
    gmres: gmres::Workspace,
    scratch: Vec<f64>,
}

/// What a direct solution must leave at most: it has no iterations that could be stopped.
const DIRECT: Stopping = Stopping { tolerance: 1e-10, max_iterations: 1 };

impl Solver {
    /// Factors of A; a direct solver's are those of A + α 1 1ᵀ/n.
    pub(super) fn factors(&self, rows: &SparseRows, alpha: Option<f64>) -> Result<Factors, String> {
        match self {
            Self::SparseLu => SparseLu::from_rows(rows, alpha)
                .map(|lu| Factors::Complete(Box::new(lu)))
                .map_err(|failed| failed.to_string()),
            _ => IncompleteFactors::from_rows(rows).map(Factors::Incomplete).map_err(|failed| failed.to_string()),
        }
    }

    /// Goes on from `x` to the solution of A x = b.
    pub(super) fn solve(
        &self,
        map: &dyn LinearMap,
        factors: &Factors,
        b: &[f64],
        x: &mut [f64],
        workspace: &mut Workspace,
    ) -> Convergence {
        let Workspace { bicgstab, gmres, scratch } = workspace;
        match (self, factors) {
            (Self::Gmres { restart, stopping }, Factors::Incomplete(factors)) => {
                gmres::solve(map, factors, b, x, *restart, *stopping, gmres)
            }
            (_, Factors::Incomplete(factors)) => bicgstab::solve(map, factors, b, x, self.stopping(), bicgstab),
            (_, Factors::Complete(factors)) => {
                factors.solve(b, x);
                Convergence::from_solution(map, b, x, 1, scratch)
            }
        }
    }

    /// When a solution is good enough.
    pub(super) fn stopping(&self) -> Stopping {
        match self {
            Self::BiCgStab(stopping) | Self::Gmres { stopping, .. } => *stopping,
            Self::SparseLu => DIRECT,
        }
    }

    /// Why a solution does not count, if it does not.
    pub(super) fn failure(&self, found: Convergence) -> Option<String> {
        let Convergence { iterations, residual, .. } = found;
        (!found.is_within(self.stopping()))
            .then(|| format!("{iterations} iterations leave a residual of {residual:.3e}"))
    }

    /// Its name, with choices.
    pub(super) fn name(&self) -> String {
        match self {
            Self::BiCgStab(_) => "BiCGSTAB with ILU(0)".to_owned(),
            Self::Gmres { restart, .. } => format!("GMRES({restart}) with ILU(0)"),
            Self::SparseLu => "sparse LU".to_owned(),
        }
    }
}
