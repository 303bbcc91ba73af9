//! du/dt = ∇_S·(d ∇_S u), with reactions of two substances or without: explicit by Dormand and Prince's pair in fixed or
//! controlled steps, or implicit by the second backward differentiation formula. What leaves the bounds of a solution is a mode of
//! the operator, and ends the run.

use super::cloud::SurfaceCloud;
use super::conservative;
use super::diffusivity::Diffusivity;
use super::evolution_parts::{EvolutionIntegrator, EvolutionParts, ExactCourse};
use super::field_bounds::FieldBounds;
use super::format_1;
use super::formula_terms::MOST_SPECIES;
use super::method::{Operators, Use, Wanted};
use super::problem::{Problem, Tools, Watched, watch};
use super::quantities::{INTEGRAL, LARGEST, LEAST, PROBES, RATE, REFERENCE};
use super::reactions::Reaction;
use super::solver::{LinearSystem, Solver, Workspace};
use super::substances::substance;
use crate::linear_algebra::SparseRows;
use crate::parallel::Interrupt;
use crate::schemes::measured_errors::{against_exact, entry};
use crate::simulation::{Check, Diagnostic, ErrorEntry, Finding, LoadError, Observables, Quantity, Section, StepError};
use crate::time::Clock;
use crate::time::embedded_pair::EmbeddedPair;
use std::collections::BTreeMap;

/// A field, or two, in time.
#[derive(Debug)]
pub struct Evolution {
    parts: EvolutionParts,
    values: Vec<f64>,
    /// Before the last step, for the formula of two steps.
    previous: Vec<f64>,
    /// Step of the controlled integrator.
    inner_step: f64,
    pair: EmbeddedPair,
    /// Rows of substances whose diffusivity varies; empty before the first step.
    varying: Vec<Option<SparseRows>>,
    /// The system of the implicit formula, for its factor of Δt.
    implicit: Option<(f64, LinearSystem)>,
    storage: Workspace,
    right: Vec<f64>,
    /// Steps of the pair that were tried.
    attempts: u64,
    iterations: u64,
    /// Largest value at each probe so far.
    peaks: Vec<f64>,
    initial_integral: f64,
    /// Integral of |u| at the start.
    initial_size: f64,
    /// Root mean square of du/dt at the end of the last step, of reactions.
    rate: f64,
    bounds: FieldBounds,
    /// Doubts of the last step.
    findings: Vec<Finding>,
    /// Values before the last step, a buffer.
    earlier: Vec<f64>,
    /// What a solver left of the integral of each part, and its area, a buffer.
    defects: Vec<[f64; 2]>,
}

impl Evolution {
    /// At the start, on a cloud.
    #[must_use]
    pub fn new<const D: usize>(mut parts: EvolutionParts, cloud: &SurfaceCloud<D>) -> Self {
        cloud.held.iter().for_each(|(i, value)| parts.initial[*i] = *value);
        let values = parts.initial.clone();
        let sizes: Vec<f64> = values[..cloud.rows].iter().map(|value| value.abs()).collect();
        Self {
            initial_size: cloud.integral(&sizes).max(f64::MIN_POSITIVE),
            previous: values.clone(),
            inner_step: 0.0,
            pair: EmbeddedPair::default(),
            varying: Vec::new(),
            implicit: None,
            storage: Workspace::default(),
            right: Vec::new(),
            attempts: 0,
            iterations: 0,
            peaks: cloud.probes.iter().map(|probe| values[*probe]).collect(),
            initial_integral: cloud.integral(&values[..cloud.rows]),
            rate: 0.0,
            bounds: FieldBounds::new(&values, parts.reaction.as_ref(), parts.source.is_some()),
            findings: Vec::new(),
            earlier: Vec::new(),
            defects: Vec::new(),
            values,
            parts,
        }
    }

    /// One step of the pair, or as many as the tolerance asks for.
    fn explicit(
        &mut self,
        operator: &SparseRows,
        interrupt: &Interrupt,
        from: Clock,
        to: Clock,
    ) -> Result<(), StepError> {
        let Self { parts, values, pair, inner_step, attempts, varying, .. } = self;
        let (parts, varying) = (&*parts, &varying[..]);
        let mut slope = |u: &[f64], time: f64, out: &mut [f64]| slopes((operator, varying), parts, u, time, out);
        let EvolutionIntegrator::Controlled { tolerance } = parts.integrator else {
            pair.try_step(values, from.time, to.time, &mut slope);
            pair.accept(values);
            *attempts += 1;
            return Ok(());
        };
        let whole = to.time - from.time;
        if *inner_step <= 0.0 {
            *inner_step = FIRST_STEP * whole;
        }
        let mut time = from.time;
        loop {
            interrupt.check()?;
            let rest = to.time - time;
            let is_last = *inner_step >= rest * (1.0 - 1e-9);
            // Two equal steps rather than a whole one and a sliver.
            let end = if is_last { to.time } else { time + inner_step.min(0.5 * rest) };
            let length = end - time;
            let error = pair.try_step(values, time, end, &mut slope);
            *attempts += 1;
            // What is no number may become one in a shorter step.
            let factor = if error.is_nan() { 0.2 } else { SAFETY * (tolerance / error.max(1e-300)).powf(0.2) };
            if error <= tolerance {
                pair.accept(values);
                time = end;
                // A step that was cut short says nothing against longer ones.
                let next = length * factor.clamp(0.2, 5.0);
                *inner_step = if length < *inner_step { next.max(*inner_step) } else { next };
                if is_last {
                    return Ok(());
                }
            } else {
                *inner_step = length * factor.clamp(0.2, 0.9);
                if *inner_step < LEAST_STEP * whole {
                    let Clock { step, time } = to;
                    if let Some(place) = pair.result().iter().position(|value| !value.is_finite()) {
                        if let Some(reason) = parts.undefined(values, time) {
                            return Err(StepError::Undefined { reason, step, time });
                        }
                        let rows = operator.rows();
                        let field = substance(place / rows).name;
                        return Err(StepError::NonFinite { field, particle: place % rows, step, time });
                    }
                    let reason = format!("the tolerance {tolerance:.1e} cannot be kept: the error is {error:.1e}");
                    return Err(StepError::Unsolved { reason, step, time });
                }
            }
        }
    }

    /// A step of the implicit formula. Conservative rows are solved in their symmetric form A (1 − c Δt Δ_S) u = A b.
    fn implicit<const D: usize>(
        &mut self,
        (cloud, operators): (&SurfaceCloud<D>, &Operators),
        solver: Solver,
        interrupt: &Interrupt,
        from: Clock,
        to: Clock,
    ) -> Result<(), StepError> {
        let whole = self.parts.time_step;
        // The first step has nothing before it.
        let is_first = from.step == 0;
        let share = if is_first { 1.0 } else { 2.0 / 3.0 };
        let is_symmetric = operators.is_conservative && solver.is_symmetric() && cloud.held.is_empty();
        let area = |i: usize| if is_symmetric { cloud.graph.areas[i] } else { 1.0 };
        let unsolved = |reason: String| StepError::Unsolved { reason, step: to.step, time: to.time };
        if self.implicit.as_ref().is_none_or(|(known, _)| *known != share) {
            let varying = self.varying.first().and_then(Option::as_ref);
            let mut rows = varying.unwrap_or(&operators.rows[0]).sorted();
            let reach = share * whole * self.parts.diffusivities.first().map_or(1.0, Diffusivity::factor);
            rows.change_rows(|i, columns, weights| {
                for (j, w) in columns.iter().zip(weights.iter_mut()) {
                    *w = area(i) * (f64::from(u8::from(*j as usize == i)) - reach * *w);
                }
            });
            let system = LinearSystem::new(rows, None, solver, is_symmetric).map_err(unsolved)?;
            self.implicit = Some((share, system));
        }
        let Self { implicit: Some((_, system)), parts, values, previous, right, storage, .. } = self else {
            return Err(unsolved("there is no system".to_owned()));
        };
        right.resize(values.len(), 0.0);
        for (i, ((right, now), before)) in right.iter_mut().zip(values.iter()).zip(previous.iter()).enumerate() {
            *right = area(i) * if is_first { *now } else { (4.0 * now - before) / 3.0 };
        }
        previous.copy_from_slice(values);
        if let Some(source) = &parts.source {
            let rates = source.rates(to.time);
            let rates = rates.map_err(|reason| StepError::Undefined { reason, step: to.step, time: to.time })?;
            for (i, (right, rate)) in right.iter_mut().zip(rates.iter()).enumerate() {
                *right += area(i) * share * whole * rate;
            }
        }
        let found = system.solve(right, values, interrupt, storage);
        interrupt.check()?;
        self.iterations += found.map_err(unsolved)?.iterations;
        if is_symmetric {
            conservative::keep_integrals(&cloud.graph, &cloud.graph.areas, right, values, &mut self.defects);
        }
        Ok(())
    }

    /// Holds the fields against their bounds. `earlier` are the values before the step.
    fn check_bounds<const D: usize>(
        &mut self,
        cloud: &SurfaceCloud<D>,
        earlier: &[f64],
        to: Clock,
    ) -> Result<(), StepError> {
        let before = self.bounds.drift;
        if cloud.areas.is_some() && self.parts.is_plain() && cloud.held.is_empty() {
            self.bounds.drift = (cloud.integral(&self.values) - self.initial_integral) / self.initial_size;
        }
        if let Some(reason) = self.bounds.violation(&self.values) {
            return Err(StepError::Unsolved { reason, step: to.step, time: to.time });
        }
        self.findings = self.bounds.findings(before, (&self.values, earlier), to);
        Ok(())
    }

    fn reference(&self, time: f64) -> Option<Vec<f64>> {
        match (self.parts.exact, &self.parts.reaction) {
            (ExactCourse::Decay(rate), _) => {
                Some(self.parts.initial.iter().map(|value| value * (-rate * time).exp()).collect())
            }
            (ExactCourse::Manufactured, Some(reaction)) => {
                let (field, _) = reaction.manufactured.as_ref()?;
                let of = |k: usize| field.iter().map(move |f| reaction.exact(*f, time)[k]);
                Some(of(0).chain(of(1)).collect())
            }
            _ => None,
        }
    }

    /// The fields that frames show, the surface's own excepted.
    #[must_use]
    pub fn shown_fields(substances: usize, has_reference: bool) -> Vec<&'static Quantity> {
        let mut fields: Vec<&'static Quantity> = (0..substances).map(substance).collect();
        fields.extend(has_reference.then_some(&REFERENCE));
        fields
    }

    /// Whether [`Self::reference`] knows one.
    fn has_reference(&self) -> bool {
        match self.parts.exact {
            ExactCourse::Unknown => false,
            ExactCourse::Decay(_) => true,
            ExactCourse::Manufactured => {
                self.parts.reaction.as_ref().is_some_and(|reaction| reaction.manufactured.is_some())
            }
        }
    }

    /// Number of unknown fields.
    fn fields(&self) -> usize {
        self.parts.reaction.as_ref().map_or(1, Reaction::species)
    }
}

/// First inner step, by the step.
const FIRST_STEP: f64 = 1e-3;
/// Inner steps below this share of a step end the run.
const LEAST_STEP: f64 = 1e-9;
const SAFETY: f64 = 0.9;

/// ∇_S·(d ∇_S u), the terms of a reaction and what a source makes.
fn slopes(
    (operator, varying): (&SparseRows, &[Option<SparseRows>]),
    parts: &EvolutionParts,
    u: &[f64],
    time: f64,
    out: &mut [f64],
) {
    let rows = operator.rows();
    for (k, (u, out)) in u.chunks(rows).zip(out.chunks_mut(rows)).enumerate() {
        varying.get(k).and_then(Option::as_ref).unwrap_or(operator).apply(u, out);
    }
    if let Some(reaction) = &parts.reaction {
        reaction.add(u, time, out);
    } else if let Some(Diffusivity::Uniform(factor)) = parts.diffusivities.first().filter(|d| d.factor() != 1.0) {
        out.iter_mut().for_each(|out| *out *= factor);
    }
    if let Some(source) = &parts.source {
        match source.rates(time) {
            Ok(rates) => out.iter_mut().zip(rates.iter()).for_each(|(out, rate)| *out += rate),
            // The step is refused, and the formula named.
            Err(_) => out.fill(f64::NAN),
        }
    }
}

impl<const D: usize> Problem<D> for Evolution {
    fn wanted(&self) -> Vec<Wanted> {
        vec![Wanted::LaplaceBeltrami]
    }

    fn purpose(&self) -> Use {
        Use::Equation
    }

    fn step(&mut self, tools: Tools<'_, D>) -> Result<(), StepError> {
        let Tools { cloud, operators, interrupt, phases, from, to } = tools;
        let operator = &operators.rows[0];
        if self.varying.is_empty() {
            self.varying = self.parts.diffusivities.iter().map(|diffusivity| diffusivity.rows(operator)).collect();
        }
        self.earlier.clone_from(&self.values);
        match self.parts.integrator {
            EvolutionIntegrator::Bdf2(solver) => {
                phases.measure("solver/solution", || self.implicit((cloud, operators), solver, interrupt, from, to))?;
            }
            _ => phases.measure("evolution", || self.explicit(operator, interrupt, from, to))?,
        }
        let earlier = std::mem::take(&mut self.earlier);
        let checked = self.check_bounds(cloud, &earlier, to);
        self.earlier = earlier;
        checked?;
        if self.parts.reaction.is_some() {
            let slope = self.pair.slope();
            self.rate = cloud.root_mean_square(slope);
        }
        for (peak, probe) in self.peaks.iter_mut().zip(&cloud.probes) {
            *peak = peak.max(self.values[*probe]);
        }
        Ok(())
    }

    fn columns(&self) -> Vec<&'static Quantity> {
        Self::shown_fields(self.fields(), self.has_reference())
    }

    fn column(&self, quantity: &Quantity, clock: Clock) -> Vec<f64> {
        let rows = self.values.len() / self.fields();
        if *quantity == REFERENCE {
            let mut reference = self.reference(clock.time).unwrap_or_default();
            reference.truncate(rows);
            reference
        } else {
            let k = (0..self.fields()).find(|k| substance(*k) == quantity).unwrap_or(0);
            self.values[k * rows..(k + 1) * rows].to_vec()
        }
    }

    fn watched(&self) -> Watched<'_> {
        let rows = self.values.len() / self.fields();
        let mut fields = self.values.chunks(rows).enumerate();
        watch(std::array::from_fn::<_, MOST_SPECIES, _>(|_| {
            fields.next().map_or(("", &[][..]), |(k, field)| (substance(k).name, field))
        }))
    }

    fn errors(&self, cloud: &SurfaceCloud<D>, clock: Clock) -> Vec<ErrorEntry> {
        let mut errors = Vec::new();
        if let Some(reference) = self.reference(clock.time) {
            errors = against_exact("value", &self.values, &reference, clock.time, "exact solution at the points");
        }
        for (probe, peak) in PROBES.into_iter().zip(&self.peaks) {
            errors.push(entry(probe.name, "peak", *peak, clock.time, "none: the largest value so far"));
        }
        // A field whose parts cancel has no mass to be lost.
        let has_mass = self.initial_integral.abs() > 1e-3 * self.initial_size;
        if cloud.areas.is_some() && self.parts.is_plain() && has_mass && cloud.held.is_empty() {
            let drift = cloud.integral(&self.values) / self.initial_integral - 1.0;
            errors.push(entry("mass", "relative", drift.abs(), clock.time, "the integral at the start"));
        }
        if self.parts.reaction.is_some() {
            let rows = self.values.len() / self.fields();
            let mean = cloud.mean(&self.values[..rows]);
            let off: Vec<f64> = self.values[..rows].iter().map(|u| u - mean).collect();
            errors.push(entry("pattern", "std", cloud.root_mean_square(&off), clock.time, "a state without a pattern"));
            if clock.step > 0 {
                errors.push(entry("pattern", "rate", self.rate, clock.time, "a steady state"));
            }
        }
        errors
    }

    fn observables(&self, cloud: &SurfaceCloud<D>, clock: Clock) -> Observables {
        let rows = self.values.len() / self.fields();
        let first = &self.values[..rows];
        let mut row: Observables = vec![
            (&INTEGRAL, cloud.integral(first)),
            (&LEAST, first.iter().copied().fold(f64::INFINITY, f64::min)),
            (&LARGEST, first.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
        ];
        if self.parts.reaction.is_some() {
            // Before the first step it is not known.
            row.push((&RATE, if clock.step == 0 { f64::NAN } else { self.rate }));
        }
        let probes = PROBES.into_iter().zip(&cloud.probes);
        row.extend(probes.map(|(quantity, probe)| (quantity, self.values[*probe])));
        row
    }

    fn save(&self, section: &mut Section) {
        section.put_reals("value", &self.values);
        section.put_reals("previous", &self.previous);
        section.put_real("inner_step", self.inner_step);
        section.put_reals("peaks", &self.peaks);
        section.put_real("rate", self.rate);
        section.put_count("attempts", self.attempts);
        section.put_count("iterations", self.iterations);
        if self.bounds.drift.is_finite() {
            section.put_real("mass_drift", self.bounds.drift);
        }
    }

    fn load(&mut self, section: &Section) -> Result<(), LoadError> {
        let value = section.reals_of("value", self.values.len())?;
        let previous = section.reals_of("previous", self.previous.len())?;
        let peaks = section.reals_of("peaks", self.peaks.len())?;
        let (inner_step, rate) = (section.real("inner_step")?, section.real("rate")?);
        let (attempts, iterations) = (section.count("attempts")?, section.count("iterations")?);
        // It is not known before the first step, and in checkpoints of earlier versions.
        let drift = if section.has("mass_drift") { section.real("mass_drift")? } else { f64::NAN };
        self.bounds.drift = drift;
        self.values.copy_from_slice(value);
        self.previous.copy_from_slice(previous);
        self.peaks.copy_from_slice(peaks);
        (self.inner_step, self.rate) = (inner_step, rate);
        (self.attempts, self.iterations) = (attempts, iterations);
        self.pair.discard_slope();
        self.implicit = None;
        self.varying.clear();
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        format_1::evolution(arrays)
    }

    fn checks(&self, _steps: u64) -> Vec<Check> {
        self.bounds.checks(&self.values)
    }

    fn findings(&self, _clock: Clock) -> Vec<Finding> {
        self.findings.clone()
    }

    fn diagnostics(&self) -> Vec<Diagnostic> {
        match self.parts.integrator {
            EvolutionIntegrator::Bdf2(_) => {
                vec![Diagnostic::count("solver.iterations", self.iterations, "Iterations of the solver in all steps.")]
            }
            _ => vec![Diagnostic::count(
                "integrator.attempts",
                self.attempts,
                "Steps of the embedded pair that were tried.",
            )],
        }
    }

    fn describe(&self, method: &mut BTreeMap<&'static str, String>) {
        let integrator = match self.parts.integrator {
            EvolutionIntegrator::FixedSteps => format!("Dormand–Prince, fixed steps, {} of them", self.attempts),
            EvolutionIntegrator::Controlled { tolerance } => {
                format!("Dormand–Prince, tolerance {tolerance:.1e}, {} steps tried", self.attempts)
            }
            EvolutionIntegrator::Bdf2(solver) => {
                let name = self.implicit.as_ref().map_or_else(|| solver.name(), |(_, system)| system.name());
                format!("BDF2, {name}, {} iterations", self.iterations)
            }
        };
        method.insert("integrator", integrator);
        let varying: Vec<String> = self.parts.diffusivities.iter().filter_map(Diffusivity::range).collect();
        if !varying.is_empty() {
            method.insert("diffusivity", format!("varies: {}", varying.join(", ")));
        }
    }
}
