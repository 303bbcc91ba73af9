//! −Δ_S u = λ u: the least eigenvalues, one a step, each with its mode.
//!
//! The first step finds all of them; step k shows the k-th. Conservative rows are symmetric in areas, so that all eigenvalues are
//! real and none is negative.

use super::cloud::SurfaceCloud;
use super::method::{Operators, Use, Wanted};
use super::problem::{Problem, Tools, Watched, watch};
use super::quantities::{RESIDUAL, VALUE};
use crate::linear_algebra::SparseRows;
use crate::linear_algebra::krylov::least_modes::{Mode, NotFound, ShiftedInverse};
use crate::linear_algebra::sparse_cholesky::SparseCholesky;
use crate::linear_algebra::sparse_lu::SparseLu;
use crate::parallel::Interrupt;
use crate::schemes::measured_errors::entry;
use crate::simulation::quantity::quantities;
use crate::simulation::{Check, Diagnostic, ErrorEntry, Finding, LoadError, Observables, Quantity, Section, StepError};
use crate::time::Clock;
use std::collections::BTreeMap;

quantities! {
    /// Scalars of the series.
    pub OBSERVABLES {
        EIGENVALUE = "eigenvalue", "1/length^2", "Eigenvalue of the step: step k has the k-th least one.";
    }
}

/// The modes, and what is known of them.
#[derive(Debug)]
pub struct Eigenmodes {
    rows: usize,
    count: usize,
    /// About the least eigenvalue that is not zero.
    shift: f64,
    /// Exact eigenvalues in ascending order; empty where they are not known.
    exact: Vec<f64>,
    modes: Vec<Mode>,
}

/// Residual of a mode, by the largest eigenvalue that is looked for, above which it does not count.
const LARGEST_RESIDUAL: f64 = 1e-6;
/// Imaginary part of an eigenvalue, by its real part, beyond which it is told.
const COMPLEX: f64 = 1e-6;
/// Eigenvalues that the report names.
const NAMED: usize = 12;

impl Eigenmodes {
    /// The least `count` eigenvalues on so many points. `shift` is about the least one that is not zero. `exact` ones are ascending.
    #[must_use]
    pub fn new(rows: usize, count: usize, shift: f64, exact: Vec<f64>) -> Self {
        Self { rows, count, shift, exact, modes: Vec::new() }
    }

    /// The fields that frames show, the surface's own excepted.
    #[must_use]
    pub fn shown_fields() -> Vec<&'static Quantity> {
        vec![&VALUE]
    }

    /// The mode of the step that the clock has reached.
    fn mode(&self, clock: Clock) -> Option<&Mode> {
        let place = usize::try_from(clock.step).ok()?.checked_sub(1)?;
        self.modes.get(place)
    }

    /// The largest eigenvalue that was looked for, beside which residuals and errors are measured.
    fn size(&self) -> f64 {
        self.modes.iter().map(|mode| mode.value).fold(self.shift, f64::max)
    }

    fn largest_residual(&self) -> f64 {
        self.modes.iter().map(|mode| mode.residual).fold(0.0, f64::max) / self.size()
    }

    /// The largest imaginary part by its eigenvalue, with the number of complex ones.
    fn complex(&self) -> (usize, f64) {
        let share = |mode: &Mode| mode.imaginary.abs() / mode.value.abs().max(self.shift);
        let shares = self.modes.iter().map(share).filter(|share| *share > COMPLEX);
        shares.fold((0, 0.0), |(count, most), share| (count + 1, f64::max(most, share)))
    }

    fn find<const D: usize>(
        &self,
        cloud: &SurfaceCloud<D>,
        operators: &Operators,
        interrupt: &Interrupt,
    ) -> Result<Vec<Mode>, String> {
        let rows = &operators.rows[0];
        let even = vec![1.0; self.rows];
        let weights = cloud.cell_areas().unwrap_or(&even);
        let is_zero = if cloud.held.is_empty() { Vec::new() } else { cloud.held_mask() };
        let factors = Factors::new(rows, weights, (self.shift, &is_zero), operators.is_conservative)?;
        let problem = ShiftedInverse {
            map: rows,
            solve: &|x| factors.solve(x),
            shift: self.shift,
            weights,
            is_symmetric: operators.is_conservative,
            is_zero: &is_zero,
        };
        match problem.least_modes(self.count, interrupt) {
            // The step is abandoned in any case.
            Err(NotFound::Interrupted) => Ok(Vec::new()),
            Ok(found) if found.len() < self.count => Err(format!(
                "the operator has {} modes, fewer than the {} that were asked for: a smaller `count` or more points help",
                found.len(),
                self.count
            )),
            found => found.map_err(|reason| reason.to_string()),
        }
    }
}

/// A decomposition of s − Δ_S, of conservative rows in their symmetric form A (s − Δ_S).
enum Factors<'a> {
    Symmetric(Box<SparseCholesky>, &'a [f64]),
    General(Box<SparseLu>),
}

impl<'a> Factors<'a> {
    fn new(
        rows: &SparseRows,
        weights: &'a [f64],
        (shift, is_zero): (f64, &[bool]),
        is_symmetric: bool,
    ) -> Result<Self, String> {
        let mut shifted = rows.sorted();
        let is_held = |j: usize| is_zero.get(j).copied().unwrap_or(false);
        shifted.change_rows(|i, columns, entries| {
            let scale = if is_symmetric { weights[i] } else { 1.0 };
            for (j, w) in columns.iter().zip(entries.iter_mut()) {
                let j = *j as usize;
                // Rows of held points are zero already.
                let own = if is_held(j) { 0.0 } else { *w };
                *w = scale * (if i == j { shift } else { 0.0 } - own);
            }
        });
        if is_symmetric {
            let factors = SparseCholesky::from_rows(&shifted).map_err(|failed| failed.to_string())?;
            Ok(Self::Symmetric(Box::new(factors), weights))
        } else {
            let factors = SparseLu::from_rows(&shifted, None).map_err(|failed| failed.to_string())?;
            Ok(Self::General(Box::new(factors)))
        }
    }

    fn solve(&self, x: &mut [f64]) {
        match self {
            Self::Symmetric(factors, weights) => {
                x.iter_mut().zip(*weights).for_each(|(x, w)| *x *= w);
                factors.solve_in_place(x);
            }
            Self::General(factors) => {
                let b = x.to_vec();
                factors.solve(&b, x);
            }
        }
    }
}

impl<const D: usize> Problem<D> for Eigenmodes {
    fn wanted(&self) -> Vec<Wanted> {
        vec![Wanted::LaplaceBeltrami]
    }

    fn purpose(&self) -> Use {
        Use::Equation
    }

    fn step(&mut self, tools: Tools<'_, D>) -> Result<(), StepError> {
        let Tools { cloud, operators, interrupt, phases, to, .. } = tools;
        if self.modes.is_empty() {
            let found = phases.measure("solver/eigenmodes", || self.find(cloud, operators, interrupt));
            interrupt.check()?;
            self.modes = found.map_err(|reason| StepError::Unsolved { reason, step: to.step, time: to.time })?;
        }
        Ok(())
    }

    fn columns(&self) -> Vec<&'static Quantity> {
        Self::shown_fields()
    }

    fn column(&self, _quantity: &Quantity, clock: Clock) -> Vec<f64> {
        self.mode(clock).map_or_else(|| vec![f64::NAN; self.rows], |mode| mode.vector.clone())
    }

    fn watched(&self) -> Watched<'_> {
        let last = self.modes.last().map_or(&[][..], |mode| &mode.vector);
        watch([("value", last)])
    }

    fn errors(&self, _cloud: &SurfaceCloud<D>, clock: Clock) -> Vec<ErrorEntry> {
        if self.modes.is_empty() || self.exact.is_empty() {
            return Vec::new();
        }
        let known = "exact eigenvalues of the surface";
        let off = |(mode, exact): (&Mode, &f64)| (mode.value - exact).abs() / exact.max(self.shift);
        let most = self.modes.iter().zip(&self.exact).map(off).fold(0.0, f64::max);
        vec![entry("eigenvalue", "relative", most, clock.time, known)]
    }

    fn observables(&self, _cloud: &SurfaceCloud<D>, clock: Clock) -> Observables {
        let mode = self.mode(clock);
        let of = |number: fn(&Mode) -> f64| mode.map_or(f64::NAN, number);
        vec![(&EIGENVALUE, of(|mode| mode.value)), (&RESIDUAL, of(|mode| mode.residual) / self.size())]
    }

    fn save(&self, section: &mut Section) {
        let all = |number: fn(&Mode) -> f64| self.modes.iter().map(number).collect::<Vec<f64>>();
        section.put_reals("eigenvalues", &all(|mode| mode.value));
        section.put_reals("imaginary_parts", &all(|mode| mode.imaginary));
        section.put_reals("residuals", &all(|mode| mode.residual));
        section
            .put_reals("modes", &self.modes.iter().flat_map(|mode| mode.vector.iter().copied()).collect::<Vec<f64>>());
    }

    fn load(&mut self, section: &Section) -> Result<(), LoadError> {
        let values = section.reals("eigenvalues")?;
        let imaginary = section.reals_of("imaginary_parts", values.len())?;
        let residuals = section.reals_of("residuals", values.len())?;
        let vectors = section.reals_of("modes", values.len() * self.rows)?;
        let mode = |k: usize| Mode {
            value: values[k],
            imaginary: imaginary[k],
            vector: vectors[k * self.rows..(k + 1) * self.rows].to_vec(),
            residual: residuals[k],
        };
        self.modes = (0..values.len()).map(mode).collect();
        Ok(())
    }

    fn translate_format_1(&self, _arrays: &Section) -> Result<Section, LoadError> {
        // Format 1 had no such problem.
        Ok(Section::default())
    }

    fn checks(&self, steps: u64) -> Vec<Check> {
        let residual = (steps > 0).then(|| self.largest_residual());
        vec![Check::at_most("mode_residual", residual, LARGEST_RESIDUAL, "")]
    }

    fn findings(&self, clock: Clock) -> Vec<Finding> {
        let (count, most) = self.complex();
        if count == 0 || clock.step != 1 {
            return Vec::new();
        }
        let message = format!(
            "{count} eigenvalues are complex, with imaginary parts up to {most:.1e} of their real parts: the rows are not \
             symmetric"
        );
        let advice = "the method `conservative` has real ones alone; more points help both";
        let finding = Finding::warning("complex_eigenvalues", message, (clock.step, clock.time));
        vec![finding.with_count(count as u64).with_advice(advice)]
    }

    fn diagnostics(&self) -> Vec<Diagnostic> {
        let doc = "Largest residual of a mode, by the largest eigenvalue.";
        let residual =
            (!self.modes.is_empty()).then(|| Diagnostic::new("modes.residual", self.largest_residual(), doc));
        residual.into_iter().collect()
    }

    fn describe(&self, method: &mut BTreeMap<&'static str, String>) {
        let values: Vec<String> = self.modes.iter().take(NAMED).map(|mode| format!("{:.6e}", mode.value)).collect();
        if !values.is_empty() {
            let more = if self.modes.len() > NAMED { ", …" } else { "" };
            method.insert("eigenvalues", values.join(", ") + more);
        }
    }
}
