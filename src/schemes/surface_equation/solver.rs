//! How the sparse systems of problems are solved: factors once, then solutions. A solution counts only by its residual.

use crate::linear_algebra::SparseRows;
use crate::linear_algebra::krylov::conjugate_gradients::{self, SymmetricFactors};
use crate::linear_algebra::krylov::{
    Convergence, IncompleteFactors, Interruptible, LinearMap, Stopping, WithMeans, bicgstab, gmres,
};
use crate::linear_algebra::mean_term::MeanTerm;
use crate::linear_algebra::sparse_lu::SparseLu;
use crate::parallel::Interrupt;

/// How sparse systems are solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Solver {
    /// Conjugate gradients for symmetric systems, BiCGSTAB for others.
    Automatic(Stopping),
    /// BiCGSTAB with ILU(0); GMRES and then a sparse LU decomposition go on where it stalls.
    BiCgStab(Stopping),
    /// GMRES, begun anew so often, with ILU(0).
    Gmres {
        /// Vectors of the basis before a restart.
        restart: usize,
        /// Tolerance and largest number of iterations.
        stopping: Stopping,
    },
    /// Conjugate gradients with incomplete Cholesky factors, for symmetric systems.
    Cg(Stopping),
    /// Sparse LU decomposition.
    SparseLu,
}

/// Factors of a system.
#[derive(Debug)]
enum Factors {
    Incomplete(IncompleteFactors),
    Symmetric(SymmetricFactors),
    Complete(Box<SparseLu>),
}

/// Vectors of solutions, to be used again.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    bicgstab: bicgstab::Workspace,
    gmres: gmres::Workspace,
    conjugate_gradients: conjugate_gradients::Workspace,
    scratch: Vec<f64>,
}

/// What a direct solution must leave at most: it has no iterations that could be stopped.
const DIRECT: Stopping = Stopping { tolerance: 1e-10, max_iterations: 1 };
/// Vectors of GMRES where it goes on after BiCGSTAB.
const RESTART: usize = 60;
/// Unknowns of a system at most that a sparse LU decomposition goes on with: it fills about 23 kB each.
const MOST_DIRECT: usize = 60_000;

impl Solver {
    /// When a solution is good enough.
    pub(super) fn stopping(&self) -> Stopping {
        match self {
            Self::Automatic(stopping)
            | Self::BiCgStab(stopping)
            | Self::Cg(stopping)
            | Self::Gmres { stopping, .. } => *stopping,
            Self::SparseLu => DIRECT,
        }
    }

    /// Whether it takes symmetric systems in their symmetric form.
    pub(super) fn is_symmetric(&self) -> bool {
        matches!(self, Self::Automatic(_) | Self::Cg(_))
    }

    /// Its name, with choices.
    pub(super) fn name(&self) -> String {
        match self {
            Self::Automatic(_) => "CG where the system is symmetric, else BiCGSTAB with ILU(0)".to_owned(),
            Self::BiCgStab(_) => "BiCGSTAB with ILU(0)".to_owned(),
            Self::Gmres { restart, .. } => format!("GMRES({restart}) with ILU(0)"),
            Self::Cg(_) => "CG with IC(0)".to_owned(),
            Self::SparseLu => "sparse LU".to_owned(),
        }
    }
}

/// A matrix with its term of means, and its factors.
#[derive(Debug)]
pub(super) struct LinearSystem {
    rows: SparseRows,
    term: Option<MeanTerm>,
    solver: Solver,
    factors: Factors,
    /// The decomposition that goes on where other methods stall. Every solution begins with `factors` all the same, so that it
    /// does not depend on earlier ones.
    fallback: Option<Factors>,
    /// Whether the rows are symmetric and positive (semi-)definite, and taken as such.
    is_symmetric: bool,
    /// What went on where the first method stalled.
    went_on: Vec<&'static str>,
}

impl LinearSystem {
    /// A system of sorted rows. With `term`, the rows map constants of each part to zero. With `is_symmetric`, the rows are
    /// symmetric and positive (semi-)definite, and the solver takes them as such; the weights of the term are equal then.
    ///
    /// # Errors
    /// The reason for which the rows could not be factorized, or conjugate gradients for rows that are not symmetric.
    pub fn new(rows: SparseRows, term: Option<MeanTerm>, solver: Solver, is_symmetric: bool) -> Result<Self, String> {
        if matches!(solver, Solver::Cg(_)) && !is_symmetric {
            return Err("conjugate gradients need a symmetric system".to_owned());
        }
        let factors = if is_symmetric {
            Factors::Symmetric(SymmetricFactors::from_rows(&rows))
        } else if solver == Solver::SparseLu {
            complete(&rows, term.as_ref())?
        } else {
            Factors::Incomplete(IncompleteFactors::from_rows(&rows).map_err(|failed| failed.to_string())?)
        };
        Ok(Self { rows, term, solver, factors, fallback: None, is_symmetric, went_on: Vec::new() })
    }

    /// Goes on from `x` to the solution of A x = b.
    ///
    /// # Errors
    /// The reason for which the solution does not count, with its residual.
    pub fn solve(
        &mut self,
        b: &[f64],
        x: &mut [f64],
        interrupt: &Interrupt,
        workspace: &mut Workspace,
    ) -> Result<Convergence, String> {
        let mut found = self.attempt((self.solver, &self.factors), b, x, interrupt, workspace);
        let stopping = self.solver.stopping();
        let goes_on = matches!(self.solver, Solver::Automatic(_) | Solver::BiCgStab(_)) && !self.is_symmetric;
        if goes_on && self.is_stalled(found, interrupt) {
            self.note("GMRES");
            clear_broken(x);
            let gmres = Solver::Gmres { restart: RESTART, stopping };
            let before = found.iterations;
            found = self.attempt((gmres, &self.factors), b, x, interrupt, workspace);
            found.iterations += before;
            if self.is_stalled(found, interrupt) && x.len() <= MOST_DIRECT {
                self.note("sparse LU");
                let factors = match self.fallback.take() {
                    Some(known) => known,
                    None => complete(&self.rows, self.term.as_ref())?,
                };
                let before = found.iterations;
                found = self.attempt((Solver::SparseLu, &factors), b, x, interrupt, workspace);
                self.fallback = Some(factors);
                found.iterations += before;
            }
        }
        if interrupt.is_raised() || found.is_within(stopping) {
            return Ok(found);
        }
        let Convergence { iterations, residual, .. } = found;
        Err(format!("{iterations} iterations leave a residual of {residual:.3e}"))
    }

    /// Whether a method ended before its last iteration without a solution.
    fn is_stalled(&self, found: Convergence, interrupt: &Interrupt) -> bool {
        let stopping = self.solver.stopping();
        !found.is_within(stopping) && found.iterations < stopping.max_iterations && !interrupt.is_raised()
    }

    fn note(&mut self, method: &'static str) {
        if !self.went_on.contains(&method) {
            self.went_on.push(method);
        }
    }

    fn attempt(
        &self,
        (solver, factors): (Solver, &Factors),
        b: &[f64],
        x: &mut [f64],
        interrupt: &Interrupt,
        workspace: &mut Workspace,
    ) -> Convergence {
        let Workspace { bicgstab, gmres, conjugate_gradients, scratch } = workspace;
        let with_means;
        let map: &dyn LinearMap = match &self.term {
            Some(term) if !self.is_symmetric => {
                with_means = WithMeans { rows: &self.rows, term };
                &with_means
            }
            _ => &self.rows,
        };
        let map = &Interruptible { map, interrupt };
        let stopping = solver.stopping();
        match (solver, factors) {
            (Solver::Gmres { restart, .. }, Factors::Incomplete(factors)) => {
                gmres::solve(map, factors, b, x, restart, stopping, gmres)
            }
            (_, Factors::Incomplete(factors)) => bicgstab::solve(map, factors, b, x, stopping, bicgstab),
            (_, Factors::Symmetric(factors)) => {
                let null_space = self.term.as_ref();
                conjugate_gradients::solve(map, factors, null_space, b, x, stopping, conjugate_gradients)
            }
            (_, Factors::Complete(factors)) => {
                factors.solve(b, x);
                Convergence::from_solution(map, b, x, 1, scratch)
            }
        }
    }

    /// The method that solved it, with those that went on where it stalled.
    pub fn name(&self) -> String {
        let first = match (self.solver, &self.factors) {
            (_, Factors::Symmetric(SymmetricFactors::Incomplete(_))) => "CG with IC(0)".to_owned(),
            (_, Factors::Symmetric(SymmetricFactors::Diagonal(_))) => "CG with the diagonal".to_owned(),
            (Solver::Automatic(stopping), _) => Solver::BiCgStab(stopping).name(),
            (solver, _) => solver.name(),
        };
        self.went_on.iter().fold(first, |name, next| format!("{name}, which stalled, then {next}"))
    }
}

fn complete(rows: &SparseRows, term: Option<&MeanTerm>) -> Result<Factors, String> {
    let found = SparseLu::from_rows(rows, term).map_err(|failed| failed.to_string())?;
    Ok(Factors::Complete(Box::new(found)))
}

/// Starts again from zero where a recurrence left numbers that are none.
fn clear_broken(x: &mut [f64]) {
    if x.iter().any(|value| !value.is_finite()) {
        x.fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::{Interrupt, LinearSystem, Solver, SparseRows, Stopping, Workspace};

    const STOPPING: Stopping = Stopping { tolerance: 1e-10, max_iterations: 5000 };

    /// A rotation by a right angle in each pair of unknowns, with a weak diagonal in scattered order: its field of values
    /// surrounds zero, and the incomplete factors are poor.
    fn hard(n: usize) -> SparseRows {
        let mut rows = SparseRows::default();
        for i in 0..n {
            let (next, far) = ((i + 1) % n, (7 * i + 3) % n);
            rows.push_row(&[i as u32, next as u32, far as u32], &[1e-3, 1.0, -0.9]);
        }
        rows.sorted()
    }

    #[test]
    fn other_methods_go_on_where_bicgstab_stalls() {
        let n = 600;
        let rows = hard(n);
        let exact: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
        let mut b = vec![0.0; n];
        rows.apply(&exact, &mut b);
        let mut system = LinearSystem::new(rows, None, Solver::BiCgStab(STOPPING), false).unwrap();
        let mut x = vec![0.0; n];
        let found = system.solve(&b, &mut x, &Interrupt::default(), &mut Workspace::default()).unwrap();
        assert!(found.is_within(STOPPING), "{found:?}");
        assert!(system.name().contains("stalled, then GMRES"), "{}", system.name());
        assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-5));
    }

    /// A checkpoint has no factors: a system that is made anew gives the same bits.
    #[test]
    fn a_solution_does_not_depend_on_earlier_ones() {
        let n = 600;
        let b = |shift: f64| (0..n).map(|i| (i as f64 + shift).sin()).collect::<Vec<f64>>();
        let make = || LinearSystem::new(hard(n), None, Solver::BiCgStab(STOPPING), false).unwrap();
        let solve = |system: &mut LinearSystem, b: &[f64], x: &mut [f64]| {
            system.solve(b, x, &Interrupt::default(), &mut Workspace::default()).unwrap()
        };
        let (mut whole, mut x) = (make(), vec![0.0; n]);
        solve(&mut whole, &b(0.0), &mut x);
        let mut restarted = x.clone();
        let found = solve(&mut whole, &b(1.0), &mut x);
        assert!(whole.name().contains("stalled"), "{}", whole.name());
        assert_eq!(solve(&mut make(), &b(1.0), &mut restarted), found);
        assert_eq!(restarted, x);
    }

    #[test]
    fn conjugate_gradients_take_symmetric_systems_alone() {
        let made = LinearSystem::new(hard(20), None, Solver::Cg(STOPPING), false);
        assert!(made.is_err_and(|reason| reason.contains("symmetric")));
    }

    #[test]
    fn a_system_without_a_solution_is_an_error() {
        let mut rows = SparseRows::default();
        // Two equal rows with different right-hand sides.
        rows.push_row(&[0, 1], &[1.0, 2.0]);
        rows.push_row(&[0, 1], &[1.0, 2.0]);
        for solver in [Solver::BiCgStab(STOPPING), Solver::SparseLu] {
            let solved = LinearSystem::new(rows.clone(), None, solver, false).and_then(|mut system| {
                system.solve(&[1.0, 2.0], &mut [0.0; 2], &Interrupt::default(), &mut Workspace::default())
            });
            assert!(solved.is_err(), "{solved:?}");
        }
    }
}
