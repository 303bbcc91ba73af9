//! Δ_S u = f: some points hold their value, or the solution has no mean.

use super::cloud::SurfaceCloud;
use super::format_1;
use super::method::Wanted;
use super::problem::{Problem, Tools, Watched};
use super::quantities::{FIELD, ITERATIONS, REFERENCE, RESIDUAL, VALUE};
use super::solver::{Solver, Workspace};
use crate::linear_algebra::SparseRows;
use crate::linear_algebra::krylov::{Convergence, Interruptible, LinearMap, WithMean};
use crate::schemes::measured_errors::{against_exact, entry};
use crate::simulation::{Check, Diagnostic, ErrorEntry, LoadError, Observables, Quantity, Section, StepError};
use crate::time::Clock;
use std::collections::BTreeMap;

/// What makes the solution one.
#[derive(Debug, Clone, PartialEq)]
pub enum Condition {
    /// These points hold these values.
    Dirichlet(Vec<(usize, f64)>),
    /// Neither the solution nor the exact one has a mean over the points; α of A + α 1 1ᵀ/n.
    ZeroMean {
        /// α, of the size of the least eigenvalue that is not zero, with its sign.
        alpha: f64,
    },
}

/// The problem, and its solution once it is there.
#[derive(Debug)]
pub struct Poisson {
    right: Vec<f64>,
    /// The solution, where it is known.
    exact: Option<Vec<f64>>,
    value: Vec<f64>,
    condition: Condition,
    solver: Solver,
    convergence: Convergence,
}

impl Poisson {
    /// The fields that frames show, the surface's own excepted.
    #[must_use]
    pub fn shown_fields(has_reference: bool) -> Vec<&'static Quantity> {
        if has_reference { vec![&VALUE, &FIELD, &REFERENCE] } else { vec![&VALUE, &FIELD] }
    }

    /// Δ_S u = `right` with the solution `exact`. Without a mean the system takes from `right` what no solution has.
    #[must_use]
    pub fn new(right: Vec<f64>, mut exact: Option<Vec<f64>>, condition: Condition, solver: Solver) -> Self {
        if let (Condition::ZeroMean { .. }, Some(exact)) = (&condition, &mut exact) {
            subtract_mean(exact);
        }
        let value = vec![0.0; right.len()];
        Self { right, exact, value, condition, solver, convergence: Convergence::default() }
    }

    /// The system: rows of held points become the identity, as large as their diagonal was.
    fn system(&self, operator: &SparseRows) -> (SparseRows, Vec<f64>) {
        let (mut rows, mut right) = (operator.sorted(), self.right.clone());
        if let Condition::Dirichlet(held) = &self.condition {
            let mut held_at = vec![None; right.len()];
            held.iter().for_each(|(i, value)| held_at[*i] = Some(*value));
            rows.change_rows(|i, columns, weights| {
                if let Some(value) = held_at[i] {
                    let diagonal = columns.iter().zip(weights.iter()).find(|(j, _)| **j as usize == i);
                    let size = diagonal.map_or(1.0, |(_, w)| *w);
                    for (j, w) in columns.iter().zip(weights.iter_mut()) {
                        *w = if *j as usize == i { size } else { 0.0 };
                    }
                    right[i] = size * value;
                }
            });
        }
        (rows, right)
    }
}

/// Takes the mean away.
fn subtract_mean(values: &mut [f64]) {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|value| *value -= mean);
}

impl<const D: usize> Problem<D> for Poisson {
    fn wanted(&self) -> Vec<Wanted> {
        vec![Wanted::LaplaceBeltrami]
    }

    fn step(&mut self, tools: Tools<'_, D>) -> Result<(), StepError> {
        let Tools { operators, interrupt, phases, to, .. } = tools;
        let (rows, right) = phases.measure("solver/assembly", || self.system(&operators.rows[0]));
        let unsolved = |reason: String| StepError::Unsolved { reason, step: to.step, time: to.time };
        let with_mean;
        let map: &dyn LinearMap = match self.condition {
            Condition::Dirichlet(_) => &rows,
            Condition::ZeroMean { alpha } => {
                with_mean = WithMean { rows: &rows, alpha };
                &with_mean
            }
        };
        let map = &Interruptible { map, interrupt };
        let alpha = if let Condition::ZeroMean { alpha } = self.condition { Some(alpha) } else { None };
        let factors = phases.measure("solver/factors", || self.solver.factors(&rows, alpha)).map_err(unsolved)?;
        let value = &mut self.value;
        self.convergence = phases
            .measure("solver/solution", || self.solver.solve(map, &factors, &right, value, &mut Workspace::default()));
        interrupt.check()?;
        if let Some(reason) = self.solver.failure(self.convergence) {
            return Err(unsolved(reason));
        }
        if let Condition::ZeroMean { .. } = self.condition {
            subtract_mean(value);
        }
        Ok(())
    }

    fn columns(&self) -> Vec<&'static Quantity> {
        Self::shown_fields(self.exact.is_some())
    }

    fn column(&self, quantity: &Quantity, clock: Clock) -> Vec<f64> {
        if *quantity == FIELD {
            self.right.clone()
        } else if *quantity == REFERENCE {
            self.exact.clone().unwrap_or_default()
        } else if clock.step == 0 {
            vec![f64::NAN; self.value.len()]
        } else {
            self.value.clone()
        }
    }

    fn watched(&self) -> Watched<'_> {
        [("value", &self.value), ("", &[])]
    }

    fn errors(&self, _cloud: &SurfaceCloud<D>, clock: Clock) -> Vec<ErrorEntry> {
        if clock.step == 0 {
            return Vec::new();
        }
        let reference = "exact solution at the points";
        let against = |exact: &Vec<f64>| against_exact("value", &self.value, exact, clock.time, reference);
        let mut errors = self.exact.as_ref().map_or_else(Vec::new, against);
        let Convergence { iterations, residual, .. } = self.convergence;
        errors.push(entry("solver", "iterations", iterations as f64, clock.time, "none"));
        errors.push(entry("solver", "residual", residual, clock.time, "‖b − A x‖ by ‖b‖"));
        errors
    }

    fn observables(&self, _cloud: &SurfaceCloud<D>, _clock: Clock) -> Observables {
        vec![(&ITERATIONS, self.convergence.iterations as f64), (&RESIDUAL, self.convergence.residual)]
    }

    fn save(&self, section: &mut Section) {
        section.put_reals("value", &self.value);
        section.put_count("iterations", self.convergence.iterations);
        section.put_real("residual", self.convergence.residual);
        section.put_real("residual_floor", self.convergence.floor);
    }

    fn load(&mut self, section: &Section) -> Result<(), LoadError> {
        let value = section.reals_of("value", self.value.len())?;
        let (iterations, residual) = (section.count("iterations")?, section.real("residual")?);
        let floor = section.real("residual_floor")?;
        self.value.copy_from_slice(value);
        self.convergence = Convergence { iterations, residual, floor };
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        format_1::poisson(arrays)
    }

    fn checks(&self, steps: u64) -> Vec<Check> {
        let residual = (steps > 0).then_some(self.convergence.residual);
        vec![Check::at_most("solver_residual", residual, self.convergence.bound(self.solver.stopping()), "")]
    }

    fn diagnostics(&self) -> Vec<Diagnostic> {
        let Convergence { iterations, residual, .. } = self.convergence;
        vec![
            Diagnostic::count("solver.iterations", iterations, "Iterations of the solver."),
            Diagnostic::new("solver.residual", residual, "Norm of b - A x by that of b."),
        ]
    }

    fn describe(&self, method: &mut BTreeMap<&'static str, String>) {
        let condition = match &self.condition {
            Condition::Dirichlet(held) => format!("{} points hold their value", held.len()),
            Condition::ZeroMean { alpha } => format!("no mean, A + {alpha:.4} 1 1ᵀ/n"),
        };
        method.insert("solver", self.solver.name());
        method.insert("condition", condition);
    }
}
