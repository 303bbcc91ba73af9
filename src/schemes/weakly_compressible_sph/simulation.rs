//! Two fluids step by step.

use super::droplets::ball_curvature;
use super::monitors::{Row, deformation, names};
use super::species::Species;
use super::stepping::Stepper;
use super::summary::Summary;
use super::system::{EvaluationError, SphSystem};
use super::time_step::{REFERENCE_SPEED, StepLimit, longest_step};
use crate::closest_point::Soundness;
use crate::geometry::Vector;
use crate::operators::Soundness as FitSoundness;
use crate::schemes::measured_errors::{closest_point_report, rescued};
use crate::simulation::state::check_length;
use crate::simulation::{
    CpuClock, Fields, Finding, Health, Observables, OutputPlan, Phases, Report, RestoreError, Simulation, State,
    StepError,
};
use crate::time::clock::TIME_SLACK;
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

/// Two fluids as a simulation.
pub struct WeaklyCompressibleSph<const D: usize> {
    system: SphSystem<D>,
    stepper: Stepper<D>,
    pace: Pace,
    plan: OutputPlan,
    step: u64,
    /// Parts that the last step was cut into.
    parts_of_step: u64,
    max_cfl: f64,
    /// Steps in a row in which no particle was too fast for rest.
    resting: u64,
    /// What the first evaluation failed with.
    failure: Option<StepError>,
    row: Row,
    summary: Summary,
    findings: Vec<Finding>,
    phases: Phases,
    method: BTreeMap<&'static str, String>,
}

/// Steps of one length from an origin: where a run began, or where its time step was changed at a restart.
#[derive(Debug, Clone, Copy)]
struct Pace {
    time_step: f64,
    end_time: f64,
    origin: Clock,
    /// The last step.
    last: u64,
}

impl Pace {
    fn new(time_step: f64, end_time: f64, origin: Clock) -> Self {
        let steps = ((end_time - origin.time) / time_step - TIME_SLACK).ceil().max(0.0) as u64;
        Self { time_step, end_time, origin, last: origin.step + steps }
    }

    fn clock(&self, step: u64) -> Clock {
        let since = step.saturating_sub(self.origin.step) as f64;
        Clock { step, time: self.origin.time + since * self.time_step }
    }

    /// For the plan of output, which thinks of equal steps from the start.
    fn fixed(&self) -> FixedStep {
        let end = self.clock(self.last);
        FixedStep { time_step: end.time / end.step.max(1) as f64, steps: end.step }
    }
}

/// Parts that a step may be cut into.
const MOST_PARTS: f64 = 64.0;
/// Steps of rest that count as rest.
const STEPS_OF_REST: u64 = 50;
/// Steps between measurements at least: each costs about as much as a step, and takes room of its own.
const LEAST_BETWEEN: u64 = 16;
/// Measurements of a run, about.
const MEASUREMENTS: u64 = 400;

/// Steps from one measurement to the next in a run of `steps`, beside those that the series asks for.
#[must_use]
pub fn measurement_interval(steps: u64) -> u64 {
    (steps / MEASUREMENTS).max(LEAST_BETWEEN)
}

impl<const D: usize> WeaklyCompressibleSph<D> {
    /// At time 0, with the first evaluation done; what went wrong with it is what the first step fails with.
    #[must_use]
    pub fn new(
        system: SphSystem<D>,
        time_step: f64,
        end_time: f64,
        plan: OutputPlan,
        cpu_clock: CpuClock,
        method: BTreeMap<&'static str, String>,
    ) -> Self {
        let mut this = Self {
            failure: None,
            stepper: Stepper::new(&system.config, system.flow.count()),
            system,
            pace: Pace::new(time_step, end_time, Clock { step: 0, time: 0.0 }),
            plan,
            step: 0,
            parts_of_step: 1,
            max_cfl: 0.0,
            resting: 0,
            row: Row::new(),
            summary: Summary::default(),
            findings: Vec::new(),
            phases: Phases::new(cpu_clock),
            method,
        };
        this.failure = this.begin().err();
        this
    }

    fn begin(&mut self) -> Result<(), StepError> {
        let start = Clock { step: 0, time: 0.0 };
        // A row of the right length, whatever happens.
        self.row = vec![f64::NAN; names(D).len()];
        self.system.evaluate(0.0, false, &mut self.phases).map_err(|error| failed(error, start))?;
        if self.system.droplets.initial_measure.is_nan()
            && let Some(moments) = self.system.moments()?
        {
            // Of a drop that is known by its particles alone, the first quadrature says what is to be kept.
            self.system.droplets.initial_measure = moments.measure;
            self.system.droplets.renew_ball_curvatures();
            self.system.evaluate(0.0, false, &mut self.phases).map_err(|error| failed(error, start))?;
        }
        self.summary.droplets = self.system.droplets.number() as f64;
        self.take_row()
    }

    /// κ₀ of one droplet that holds everything.
    fn whole_curvature(&self) -> f64 {
        ball_curvature::<D>(self.system.droplets.initial_measure)
    }

    fn time_of_part(&self) -> f64 {
        self.pace.time_step / self.parts_of_step as f64
    }

    /// Takes a row, and what the summary wants of it.
    fn take_row(&mut self) -> Result<(), StepError> {
        let time_step = self.time_of_part();
        let system = &self.system;
        let moments = self.phases.measure("measure", || system.moments())?;
        self.row = self.phases.measure("measure", || system.row(time_step, moments.as_ref()));
        let Clock { time, .. } = self.clock();
        let of = |name: &str| names(D).iter().position(|n| *n == name).map_or(f64::NAN, |k| self.row[k]);
        let jump = of("pressure_inside") - of("pressure_outside");
        let momentum = self.row[1..=D].iter().map(|m| m * m).sum::<f64>().sqrt();
        let numbers = [jump, of("pressure_eos_jump"), of("curvature_mean"), of("curvature_std"), momentum];
        self.summary.take(time >= 0.8 * self.end().time, numbers);
        if let Some(moments) = moments {
            let turned = self.summary.take_shape(time, moments.measure, deformation(&moments));
            if let Some((name, message)) = turned {
                self.findings.push(Finding { name, message, time });
            }
        }
        Ok(())
    }

    fn is_row_due(&self, step: u64) -> bool {
        step >= self.pace.last
            || self.plan.is_series_due(&self.pace.fixed(), step)
            || step.is_multiple_of(measurement_interval(self.pace.last))
    }

    /// How many parts a step must be cut into, for the present speed.
    fn parts_needed(&self, next: Clock) -> Result<u64, StepError> {
        if !self.system.config.is_adaptive {
            return Ok(1);
        }
        let speed = self.system.flow.largest_speed();
        let StepLimit { length: limit, .. } = longest_step(&self.system.config, speed);
        let parts = (self.pace.time_step / limit - 1e-9).ceil().max(1.0);
        if parts <= MOST_PARTS {
            return Ok(parts as u64);
        }
        let (time_step, stable) = (self.pace.time_step, limit);
        Err(StepError::TimeStepFloor { speed, time_step, stable, step: next.step, time: next.time })
    }

    fn check(&mut self, next: Clock) -> Result<(), StepError> {
        let system = &self.system;
        let of = |field, particle| StepError::NonFinite { field, particle, step: next.step, time: next.time };
        let broken = |values: &[Vector<D>]| values.iter().position(|v| v.iter().any(|c| !c.is_finite()));
        if let Some(particle) = broken(&system.flow.velocity) {
            return Err(of("velocity", particle));
        }
        if let Some(particle) = system.flow.density.iter().position(|d| !d.is_finite()) {
            return Err(of("density", particle));
        }
        if let Some((field, particle)) = system.columns.find_broken(&system.particles) {
            return Err(of(field, particle));
        }
        let mut fastest = (0, 0.0);
        for (i, u) in system.flow.velocity.iter().enumerate() {
            let square = u.norm_squared();
            if square > fastest.1 {
                fastest = (i, square);
            }
        }
        let (particle, speed) = (fastest.0, fastest.1.sqrt());
        self.max_cfl = self.max_cfl.max(speed * self.time_of_part() / system.config.spacing);
        let sound_speed = system.flow.fluid(particle).sound_speed;
        if speed > sound_speed {
            // What would have held at the speeds that a sound run has.
            let StepLimit { length: stable, cause: bound } = longest_step(&system.config, REFERENCE_SPEED);
            let time_step = self.time_of_part();
            let Clock { step, time } = next;
            return Err(StepError::TooFast { particle, speed, sound_speed, time_step, stable, bound, step, time });
        }
        self.resting = match system.config.rest_below {
            Some(limit) if speed < limit => self.resting + 1,
            _ => 0,
        };
        if self.resting == STEPS_OF_REST {
            let message = format!("no particle has been faster than {speed:.3e} for {STEPS_OF_REST} steps");
            self.findings.push(Finding { name: "came_to_rest", message, time: next.time });
        }
        Ok(())
    }
}

fn failed(error: EvaluationError, at: Clock) -> StepError {
    match error {
        EvaluationError::Interrupted => StepError::Interrupted,
        EvaluationError::Lost => StepError::InterfaceLost { step: at.step, time: at.time },
    }
}

/// The species of all particles.
fn species_of(state: &State) -> Result<Vec<Species>, RestoreError> {
    let unknown = || RestoreError::Missing { name: "phase of 0 or 1".to_owned() };
    state.counts("phase")?.iter().map(|code| Species::from_code(*code).ok_or_else(unknown)).collect()
}

/// What was counted of the fits of the flow.
fn fits_of(state: &State) -> Result<FitSoundness, RestoreError> {
    let (counts, pivot) = (state.counts("flow")?, state.reals("flow_pivot")?);
    check_length("flow_pivot", pivot.len(), 1)?;
    let of_length: Result<[u64; 4], _> = counts.try_into();
    let length = |_| RestoreError::Length { name: "flow".to_owned(), got: counts.len(), expected: 4 };
    Ok(FitSoundness::from_numbers(of_length.map_err(length)?, pivot[0]))
}

impl<const D: usize> Simulation for WeaklyCompressibleSph<D> {
    fn clock(&self) -> Clock {
        self.pace.clock(self.step)
    }

    fn end(&self) -> Clock {
        self.pace.clock(self.pace.last)
    }

    fn is_finished(&self) -> bool {
        self.step >= self.pace.last || self.resting >= STEPS_OF_REST
    }

    /// 1. The parts that the limits ask for. 2. Each part by the integrator. 3. A look at soundness and, where due, a row.
    fn step(&mut self) -> Result<(), StepError> {
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        let (start, next) = (self.clock(), self.pace.clock(self.step + 1));
        self.parts_of_step = self.parts_needed(next)?;
        let part = self.time_of_part();
        for k in 0..self.parts_of_step {
            let time = start.time + k as f64 * part;
            let changed = self
                .stepper
                .advance(&mut self.system, time, part, &mut self.phases)
                .map_err(|error| failed(error, next))?;
            if let Some(droplets) = changed {
                let name = if droplets as f64 > self.summary.droplets { "split" } else { "merged" };
                let message = format!("there are {droplets} droplets now");
                self.findings.push(Finding { name, message, time: time + part });
                self.summary.droplets = droplets as f64;
            }
        }
        self.check(next)?;
        self.step = next.step;
        if self.is_row_due(next.step) || self.is_finished() {
            self.take_row()?;
        }
        Ok(())
    }

    fn observables(&self) -> Observables {
        let mut row = vec![("time", self.clock().time), ("time_step", self.time_of_part())];
        row.extend(names(D).into_iter().zip(self.row.iter().copied()));
        row
    }

    fn fields(&self) -> Fields {
        let system = &self.system;
        let mut fields = Fields::at(system.particles.positions());
        if system.config.has_tension() {
            if system.interface.level_set().is_some() {
                fields.surface(&system.particles, &system.columns, true);
            } else {
                let band = system.particles.flag(system.columns.in_band);
                let known = |i: usize, value: f64| if band[i] == 1 { value } else { f64::NAN };
                let (normal, curvature) =
                    (system.particles.vector(system.columns.normal), system.particles.scalar(system.columns.curvature));
                fields.vector("normal", normal.iter().enumerate().map(|(i, n)| n.map(|c| known(i, c))));
                fields.scalar("curvature", curvature.iter().enumerate().map(|(i, c)| known(i, *c)).collect());
            }
        }
        fields.vector("velocity", system.flow.velocity.iter().copied());
        fields.scalar("density", system.flow.density.clone());
        let pressures = system.flow.pressure.iter().enumerate();
        fields.scalar("pressure", pressures.map(|(i, p)| p + system.absorbed_pressure(i)).collect());
        fields.scalar("phase", system.flow.species.iter().map(|species| f64::from(species.code())).collect());
        if !system.config.fluids.have_one_mass() {
            fields.scalar("mass", (0..system.flow.count()).map(|i| system.flow.mass(i)).collect());
        }
        fields.id("particle_id", (0..system.flow.count() as u64).collect());
        fields
    }

    fn state(&self) -> State {
        let Clock { step, time } = self.clock();
        let system = &self.system;
        let mut state = State { step, time, ..State::default() };
        state.push_particles(&system.particles);
        state.push_vectors("velocity", &system.flow.velocity);
        state.push_vectors("acceleration", &system.rates.acceleration);
        state.push_vectors("reference", &system.pairs.lists.reference);
        state.push_reals("density", &system.flow.density);
        state.push_reals("density_rate", &system.rates.density);
        let flags = |values: &[u8]| values.iter().map(|v| u64::from(*v)).collect();
        state.push_counts("phase", system.flow.species.iter().map(|species| u64::from(species.code())).collect());
        let candidates = system.interface.level_set().map(|level_set| flags(&level_set.is_candidate));
        state.push_counts("candidate", candidates.unwrap_or_else(|| vec![0; system.flow.count()]));
        state.push_counts("droplet", flags(&system.droplets.label));
        state.push_reals("ball_curvatures", &system.droplets.ball_curvatures);
        let (counts, condition, bounded) = system.interface.level_set().map_or((Vec::new(), 0.0, 0), |interface| {
            let soundness = interface.surface.soundness();
            let counts = soundness.counts.entries().iter().map(|e| e.1).collect();
            (counts, soundness.worst_condition, interface.bounded)
        });
        state.push_counts("rescues", counts);
        state.push_counts("counters", vec![self.parts_of_step, self.resting, bounded, system.strays.absorbed]);
        state.push_reals("monitors", &[self.max_cfl, condition, system.droplets.initial_measure]);
        let Clock { step, time } = self.pace.origin;
        state.push_counts("origin_step", vec![step]);
        state.push_reals("origin", &[time, self.pace.time_step]);
        // What is not known is no number, which a checkpoint's arrays of numbers would not hold: their bits are kept.
        state.push_counts("row", self.row.iter().map(|v| v.to_bits()).collect());
        if let Some(flow) = system.equations.fits() {
            let (counts, least_pivot) = flow.soundness.to_numbers();
            state.push_counts("flow", counts.to_vec());
            state.push_reals("flow_pivot", &[least_pivot]);
        }
        let summary = self.summary.to_numbers(self.pace.end_time);
        state.push_counts("summary", summary.iter().map(|v| v.to_bits()).collect());
        state
    }

    fn restore(&mut self, state: &State) -> Result<(), RestoreError> {
        let (origin_step, origin) = (state.counts("origin_step")?, state.reals("origin")?);
        check_length("origin_step", origin_step.len(), 1)?;
        check_length("origin", origin.len(), 2)?;
        let is_same_pace = origin[1].to_bits() == self.pace.time_step.to_bits();
        let origin = if is_same_pace {
            Clock { step: origin_step[0], time: origin[0] }
        } else {
            Clock { step: state.step, time: state.time }
        };
        let pace = Pace::new(self.pace.time_step, self.pace.end_time, origin);
        if state.step > pace.last {
            return Err(RestoreError::Beyond { step: state.step, last: pace.last });
        }
        let count = self.system.flow.count();
        for name in ["velocity", "acceleration", "reference"] {
            check_length(name, state.reals(name)?.len(), count * D)?;
        }
        check_length("density", state.reals("density")?.len(), count)?;
        check_length("density_rate", state.reals("density_rate")?.len(), self.system.rates.density.len())?;
        for name in ["phase", "candidate", "droplet"] {
            check_length(name, state.counts(name)?.len(), count)?;
        }
        let species = species_of(state)?;
        let (rescues, counters, monitors) =
            (state.counts("rescues")?, state.counts("counters")?, state.reals("monitors")?);
        let entries = self.system.interface.level_set().map_or(0, |i| i.surface.soundness().counts.entries().len());
        check_length("rescues", rescues.len(), entries)?;
        check_length("counters", counters.len(), 4)?;
        check_length("monitors", monitors.len(), 3)?;
        check_length("row", state.counts("row")?.len(), self.row.len())?;
        let flow = match self.system.equations.fits() {
            Some(_) => Some(fits_of(state)?),
            None => None,
        };
        let numbers = |name| -> Result<Vec<f64>, RestoreError> {
            Ok(state.counts(name)?.iter().map(|bits| f64::from_bits(*bits)).collect())
        };
        let (row, summary) = (numbers("row")?, numbers("summary")?);
        let got = summary.len();
        let Some(summary) = Summary::from_numbers(&summary, pace.end_time) else {
            return Err(RestoreError::Length { name: "summary".to_owned(), got, expected: Summary::HEAD });
        };
        state.pull_particles(&mut self.system.particles)?;
        let system = &mut self.system;
        let vectors = |name: &str, to: &mut [Vector<D>]| -> Result<(), RestoreError> {
            for (vector, numbers) in to.iter_mut().zip(state.reals(name)?.chunks_exact(D)) {
                vector.as_mut_slice().copy_from_slice(numbers);
            }
            Ok(())
        };
        vectors("velocity", &mut system.flow.velocity)?;
        vectors("acceleration", &mut system.rates.acceleration)?;
        vectors("reference", &mut system.pairs.lists.reference)?;
        system.flow.density.copy_from_slice(state.reals("density")?);
        system.rates.density.copy_from_slice(state.reals("density_rate")?);
        let flags = |name: &str, to: &mut [u8]| -> Result<(), RestoreError> {
            for (flag, count) in to.iter_mut().zip(state.counts(name)?) {
                *flag = (*count).min(255) as u8;
            }
            Ok(())
        };
        system.flow.species.copy_from_slice(&species);
        if let Some(level_set) = system.interface.level_set_mut() {
            flags("candidate", &mut level_set.is_candidate)?;
        }
        flags("droplet", &mut system.droplets.label)?;
        system.droplets.ball_curvatures = state.reals("ball_curvatures")?.to_vec();
        system.droplets.initial_measure = monitors[2];
        system.strays.absorbed = counters[3];
        if let Some(interface) = system.interface.level_set_mut() {
            let soundness = interface.surface.soundness_mut();
            soundness.counts.restore(rescues);
            soundness.worst_condition = monitors[1];
            interface.bounded = counters[2];
        }
        if let (Some(known), Some(flow)) = (flow, system.equations.fits_mut()) {
            flow.soundness = known;
        }
        // An interrupt ends the run before its next step.
        let _ = system.derive();
        self.failure = None;
        self.pace = pace;
        self.max_cfl = monitors[0];
        self.parts_of_step = counters[0].max(1);
        self.resting = counters[1];
        self.row = row;
        self.summary = summary;
        self.findings.clear();
        self.step = state.step;
        Ok(())
    }

    fn report(&self) -> Report {
        let nothing = Soundness::default();
        let soundness = self.system.interface.level_set().map_or(&nothing, |interface| interface.surface.soundness());
        let whole = self.whole_curvature();
        let expected = (self.system.config.tension * whole, whole, self.system.droplets.initial_measure);
        let errors = self.summary.entries(D, self.clock().time, expected);
        let mut report = closest_point_report(soundness, errors, self.health(), self.method.clone());
        if let Some(interface) = self.system.interface.level_set().filter(|interface| interface.bounded > 0) {
            report.newton.rescued.insert("curvature.bounded", interface.bounded);
        }
        if let Some(flow) = self.system.equations.fits() {
            let found = &flow.soundness;
            report.worst_condition = report.worst_condition.max(1.0 / found.least_pivot);
            let counts = [
                ("flow.larger_radius", found.enlarged),
                ("flow.low_rank", found.low_rank),
                ("flow.unresolved", found.unresolved),
                ("flow.failed", found.failed),
            ];
            report.rescued_fits.extend(counts.into_iter().filter(|(_, count)| *count > 0));
        }
        if self.system.strays.absorbed > 0 {
            report.newton.rescued.insert("strays.absorbed", self.system.strays.absorbed);
        }
        report
    }

    fn phases(&self) -> &Phases {
        &self.phases
    }

    fn health(&self) -> Health {
        let soundness = self.system.interface.level_set().map(|interface| interface.surface.soundness());
        let fits = self.system.equations.fits().map_or(0, |flow| flow.soundness.rescued());
        Health {
            finite: self.system.flow.velocity.iter().all(|u| u.iter().all(|c| c.is_finite())),
            max_cfl: self.max_cfl,
            volume_drift: self
                .summary
                .last_measure()
                .map(|measure| measure / self.system.droplets.initial_measure - 1.0),
            rescued_fits: fits + soundness.map_or(0, |soundness| rescued(&soundness.counts)),
        }
    }

    fn particle_count(&self) -> usize {
        self.system.particles.len()
    }

    fn take_findings(&mut self) -> Vec<Finding> {
        std::mem::take(&mut self.findings)
    }
}

#[cfg(test)]
mod tests;
