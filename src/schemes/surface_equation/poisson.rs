//! Δ_S u = f: some points hold their value, or the solution has no mean on any part of the surface.
//!
//! On a closed part the equation has a solution only if f has no mean. What is taken from f is reported: its area mean, and
//! what the rows want beyond that. The second part tells how far the rows are from conserving.

use super::cloud::SurfaceCloud;
use super::format_1;
use super::method::{Use, Wanted};
use super::problem::{Problem, Tools, Watched, watch};
use super::quantities::{FIELD, ITERATIONS, REFERENCE, RESIDUAL, VALUE};
use super::solver::{LinearSystem, Solver, Workspace};
use crate::linear_algebra::SparseRows;
use crate::linear_algebra::krylov::Convergence;
use crate::linear_algebra::mean_term::MeanTerm;
use crate::schemes::measured_errors::{against_exact, entry};
use crate::simulation::{Check, Diagnostic, ErrorEntry, Finding, LoadError, Observables, Quantity, Section, StepError};
use crate::time::Clock;
use std::collections::BTreeMap;

/// What makes the solution one.
#[derive(Debug, Clone, PartialEq)]
pub enum Condition {
    /// These points hold these values.
    Dirichlet(Vec<(usize, f64)>),
    /// Neither the solution nor the exact one has a mean over a part; α of A + α 1 1ᵀ/n where areas are not known.
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
    /// The method that solved it.
    solved_by: Option<String>,
    /// The constant taken from the right-hand side in each part; empty where points hold their value.
    constants: Vec<f64>,
    /// Largest constant beyond the area mean of the right-hand side, by its root mean square; NaN before it is known.
    incompatibility: f64,
}

/// The incompatibility beyond which a solution is doubtful. Measured: up to 4e-4 on clouds that are resolved, 8e-3 and more where
/// single rows weigh much.
const INCOMPATIBLE: f64 = 5e-3;
/// Constants of parts that the report names.
const NAMED: usize = 5;

impl Poisson {
    /// The fields that frames show, the surface's own excepted.
    #[must_use]
    pub fn shown_fields(has_reference: bool) -> Vec<&'static Quantity> {
        if has_reference { vec![&VALUE, &FIELD, &REFERENCE] } else { vec![&VALUE, &FIELD] }
    }

    /// Δ_S u = `right` on a cloud with the solution `exact`, whose means are taken from it where no points hold their value.
    #[must_use]
    pub fn new<const D: usize>(
        right: Vec<f64>,
        mut exact: Option<Vec<f64>>,
        condition: Condition,
        solver: Solver,
        cloud: &SurfaceCloud<D>,
    ) -> Self {
        if let (Condition::ZeroMean { alpha }, Some(exact)) = (&condition, &mut exact) {
            cloud.mean_term(*alpha).subtract_means(exact);
        }
        let value = vec![0.0; right.len()];
        let (convergence, solved_by) = (Convergence::default(), None);
        let (constants, incompatibility) = (Vec::new(), f64::NAN);
        Self { right, exact, value, condition, solver, convergence, solved_by, constants, incompatibility }
    }

    /// The system: rows of held points become the identity, as large as their diagonal was.
    fn system(&self, operator: &SparseRows) -> (SparseRows, Vec<f64>) {
        let (mut rows, mut right) = (operator.sorted(), self.right.clone());
        if let Condition::Dirichlet(held) = &self.condition {
            let mut held_at = vec![None; right.len()];
            held.iter().for_each(|(i, value)| held_at[*i] = Some(*value));
            // Rows of points at held edges are empty.
            let largest =
                (0..right.len()).flat_map(|i| operator.row(i).1).fold(f64::MIN_POSITIVE, |most, w| most.max(w.abs()));
            rows.change_rows(|i, columns, weights| {
                if let Some(value) = held_at[i] {
                    let diagonal = columns.iter().zip(weights.iter()).find(|(j, _)| **j as usize == i);
                    let size = diagonal.map_or(0.0, |(_, w)| *w);
                    let size = if size == 0.0 { -largest } else { size };
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

impl Poisson {
    /// Solves with held points.
    fn solve_held<const D: usize>(&mut self, tools: Tools<'_, D>) -> Result<(), String> {
        let Tools { operators, interrupt, phases, .. } = tools;
        let (rows, right) = phases.measure("solver/assembly", || self.system(&operators.rows[0]));
        let mut system = phases.measure("solver/factors", || LinearSystem::new(rows, None, self.solver, false))?;
        let solve = || system.solve(&right, &mut self.value, interrupt, &mut Workspace::default());
        self.convergence = phases.measure("solver/solution", solve)?;
        self.solved_by = Some(system.name());
        Ok(())
    }

    /// Solves without means.
    ///
    /// 1. The area mean of the right-hand side is taken from it, part by part. 2. Conservative rows are solved in their symmetric
    ///    form −A Δ_S u = −A f by a solver that takes it. Others get the term of means, whose multipliers are the constants that
    ///    are taken from f beyond its mean. 3. The mean of the solution is taken from it.
    fn solve_free<const D: usize>(&mut self, alpha: f64, tools: Tools<'_, D>) -> Result<(), String> {
        let Tools { cloud, operators, interrupt, phases, .. } = tools;
        let term = cloud.mean_term(alpha);
        let mut right = self.right.clone();
        self.constants = term.subtract_means(&mut right);
        let size = cloud.root_mean_square(&right);
        let is_symmetric = operators.is_conservative && self.solver.is_symmetric();
        let (rows, system_term) = phases.measure("solver/assembly", || {
            let mut rows = operators.rows[0].sorted();
            if is_symmetric {
                rows.change_rows(|i, _, weights| weights.iter_mut().for_each(|w| *w *= -cloud.graph.areas[i]));
                right.iter_mut().zip(&cloud.graph.areas).for_each(|(right, area)| *right *= -area);
                // Constants of a symmetric matrix lie on both sides with equal weights.
                let equal = vec![1.0; right.len()];
                (rows, MeanTerm::new(term.parts().to_vec(), equal, term.alpha().to_vec()))
            } else {
                (rows, term.clone())
            }
        });
        let factors = || LinearSystem::new(rows, Some(system_term), self.solver, is_symmetric);
        let mut system = phases.measure("solver/factors", factors)?;
        let solve = || system.solve(&right, &mut self.value, interrupt, &mut Workspace::default());
        self.convergence = phases.measure("solver/solution", solve)?;
        self.solved_by = Some(system.name());
        let means = term.subtract_means(&mut self.value);
        let beyond: Vec<f64> = if is_symmetric {
            vec![0.0; means.len()]
        } else {
            means.iter().zip(term.alpha()).map(|(mean, alpha)| mean * alpha).collect()
        };
        let largest = beyond.iter().fold(0.0_f64, |most, constant| most.max(constant.abs()));
        self.incompatibility = largest / size.max(f64::MIN_POSITIVE);
        self.constants.iter_mut().zip(&beyond).for_each(|(constant, beyond)| *constant += beyond);
        Ok(())
    }
}

impl<const D: usize> Problem<D> for Poisson {
    fn wanted(&self) -> Vec<Wanted> {
        vec![Wanted::LaplaceBeltrami]
    }

    fn purpose(&self) -> Use {
        Use::Equation
    }

    fn step(&mut self, tools: Tools<'_, D>) -> Result<(), StepError> {
        let (to, interrupt) = (tools.to, tools.interrupt);
        let solved = match self.condition {
            Condition::Dirichlet(_) => self.solve_held(tools),
            Condition::ZeroMean { alpha } => self.solve_free(alpha, tools),
        };
        interrupt.check()?;
        solved.map_err(|reason| StepError::Unsolved { reason, step: to.step, time: to.time })
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
        watch([("value", &self.value)])
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
        if !self.constants.is_empty() {
            section.put_reals("constants", &self.constants);
            section.put_real("incompatibility", self.incompatibility);
        }
    }

    fn load(&mut self, section: &Section) -> Result<(), LoadError> {
        let value = section.reals_of("value", self.value.len())?;
        let (iterations, residual) = (section.count("iterations")?, section.real("residual")?);
        let floor = section.real("residual_floor")?;
        // There are none with held points, before the step, and in checkpoints of earlier versions.
        let is_known = section.has("constants");
        let constants = if is_known { section.reals("constants")?.to_vec() } else { Vec::new() };
        let incompatibility = if is_known { section.real("incompatibility")? } else { f64::NAN };
        self.value.copy_from_slice(value);
        self.convergence = Convergence { iterations, residual, floor };
        (self.constants, self.incompatibility) = (constants, incompatibility);
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        format_1::poisson(arrays)
    }

    fn checks(&self, steps: u64) -> Vec<Check> {
        let residual = (steps > 0).then_some(self.convergence.residual);
        let mut checks =
            vec![Check::at_most("solver_residual", residual, self.convergence.bound(self.solver.stopping()), "")];
        checks.push(Check::watched("incompatibility", Some(self.incompatibility), ""));
        checks
    }

    fn findings(&self, clock: Clock) -> Vec<Finding> {
        let at = (clock.step, clock.time);
        let mut findings = Vec::new();
        if self.constants.len() > 1 {
            let message = format!(
                "the surface has {} parts; each is solved by itself, with the constants {} taken from its right-hand side",
                self.constants.len(),
                self.named_constants()
            );
            findings.push(Finding::info("parts", message, at).with_count(self.constants.len() as u64));
        }
        if self.incompatibility > INCOMPATIBLE {
            let message = format!(
                "the rows take {:.1e} of the right-hand side beyond its mean (doubtful above {INCOMPATIBLE:e}): single rows \
                 weigh much",
                self.incompatibility
            );
            let advice = "the method `conservative` takes nothing beyond the mean; more points help both";
            findings.push(Finding::warning("incompatible", message, at).with_advice(advice));
        }
        findings
    }

    fn diagnostics(&self) -> Vec<Diagnostic> {
        let Convergence { iterations, residual, .. } = self.convergence;
        let mut diagnostics = vec![
            Diagnostic::count("solver.iterations", iterations, "Iterations of the solver."),
            Diagnostic::new("solver.residual", residual, "Norm of b - A x by that of b."),
        ];
        if self.incompatibility.is_finite() {
            let doc =
                "Largest constant taken from the right-hand side of a part beyond its mean, by its root mean square.";
            diagnostics.push(Diagnostic::new("poisson.incompatibility", self.incompatibility, doc));
        }
        diagnostics
    }

    fn describe(&self, method: &mut BTreeMap<&'static str, String>) {
        let condition = match &self.condition {
            Condition::Dirichlet(held) => format!("{} points hold their value", held.len()),
            Condition::ZeroMean { .. } if self.constants.is_empty() => "no mean".to_owned(),
            Condition::ZeroMean { .. } => {
                format!("no mean; constants taken from the right-hand side: {}", self.named_constants())
            }
        };
        method.insert("solver", self.solved_by.clone().unwrap_or_else(|| self.solver.name()));
        method.insert("condition", condition);
    }
}

impl Poisson {
    /// The first few constants of the parts.
    fn named_constants(&self) -> String {
        let named: Vec<String> = self.constants.iter().take(NAMED).map(|constant| format!("{constant:.4e}")).collect();
        let more = if self.constants.len() > NAMED { ", …" } else { "" };
        named.join(", ") + more
    }
}
