//! Two fluids step by step.

use super::droplets::ball_curvature;
use super::format_1;
use super::frame_fields;
use super::interface::LevelSet;
use super::monitors::{Row, deformation, load_row, names, save_row};
use super::pacing::{PACING, measurement_interval};
use super::quantities::{TIME, TIME_STEP};
use super::species::Species;
use super::stepping::Stepper;
use super::summary::Summary;
use super::system::{EvaluationError, SphSystem};
use super::time_step::{REFERENCE_SPEED, StepLimit, longest_step};
use crate::closest_point::FitDiagnostics;
use crate::operators::SupportDiagnostics;
use crate::schemes::measured_errors::{FLOW_FITS, closest_point_diagnostics, support_diagnostics};
use crate::simulation::components::{check_particles, load_particles, save_particles};
use crate::simulation::course::{check_finite, check_finite_vectors, first_broken, is_finite};
use crate::simulation::section::{copy_vectors, known};
use crate::simulation::{
    Check, Course, CpuClock, Diagnostic, Fields, Finding, Health, LoadError, Observables, OutputPlan, Phases, Report,
    Section, Selection, Simulation, StepError,
};
use crate::time::{Clock, FixedStep, Pace};
use std::collections::BTreeMap;

/// Two fluids as a simulation.
pub struct WeaklyCompressibleSph<const D: usize> {
    system: SphSystem<D>,
    stepper: Stepper<D>,
    plan: OutputPlan,
    end_time: f64,
    /// Parts that the last step was cut into.
    parts_of_step: u64,
    max_cfl: f64,
    /// Steps in a row in which no particle was too fast for rest.
    resting: u64,
    /// Failure of the first evaluation.
    failure: Option<StepError>,
    row: Row,
    summary: Summary,
    course: Course,
}

/// Equal steps from the start that end like a run, for the plan of output.
fn mean_steps(pace: &Pace) -> FixedStep {
    let end = pace.clock(pace.last);
    FixedStep { time_step: end.time / end.step.max(1) as f64, steps: end.step }
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
        let pace = Pace::new(time_step, end_time, Clock { step: 0, time: 0.0 });
        let mut this = Self {
            failure: None,
            stepper: Stepper::new(&system.config, system.flow.count()),
            system,
            plan,
            end_time,
            parts_of_step: 1,
            max_cfl: 0.0,
            resting: 0,
            row: Row::new(),
            summary: Summary::new(end_time),
            course: Course::new(pace, Phases::new(cpu_clock), method),
        };
        this.failure = this.begin().err();
        this
    }

    fn begin(&mut self) -> Result<(), StepError> {
        let start = Clock { step: 0, time: 0.0 };
        // A row of the right length, whatever happens.
        self.row = vec![f64::NAN; names(D).len()];
        self.system.evaluate(0.0, false, &mut self.course.phases).map_err(|error| failed(error, start))?;
        if self.system.droplets.initial_measure.is_nan()
            && let Some(moments) = self.system.moments()?
        {
            // Of a drop that is known by its particles alone, the first quadrature says what is to be kept.
            self.system.droplets.initial_measure = moments.area_or_volume;
            self.system.droplets.renew_ball_curvatures();
            self.system.evaluate(0.0, false, &mut self.course.phases).map_err(|error| failed(error, start))?;
        }
        self.summary.droplets = self.system.droplets.number() as f64;
        self.take_row()
    }

    /// κ₀ of one droplet that holds everything.
    fn whole_curvature(&self) -> f64 {
        ball_curvature::<D>(self.system.droplets.initial_measure)
    }

    fn time_of_part(&self) -> f64 {
        self.course.pace.time_step / self.parts_of_step as f64
    }

    /// Takes a row, and what the summary wants of it.
    fn take_row(&mut self) -> Result<(), StepError> {
        let time_step = self.time_of_part();
        let system = &self.system;
        let moments = self.course.phases.measure("measure", || system.moments())?;
        self.row = self.course.phases.measure("measure", || system.row(time_step, moments.as_ref()));
        let Clock { step, time } = self.clock();
        let of =
            |name: &str| names(D).iter().position(|quantity| quantity.name == name).map_or(f64::NAN, |k| self.row[k]);
        let jump = of("pressure_inside") - of("pressure_outside");
        let momentum = self.row[1..=D].iter().map(|m| m * m).sum::<f64>().sqrt();
        let numbers = [jump, of("pressure_eos_jump"), of("curvature_mean"), of("curvature_std"), momentum];
        self.summary.take(time >= 0.8 * self.end().time, numbers);
        if let Some(moments) = moments {
            let turned = self.summary.take_shape(time, moments.area_or_volume, deformation(&moments));
            if let Some((code, message)) = turned {
                self.course.findings.push(Finding::info(code, message, (step, time)));
            }
        }
        Ok(())
    }

    fn is_row_due(&self, step: u64) -> bool {
        step >= self.course.pace.last
            || self.plan.is_series_due(&mean_steps(&self.course.pace), step)
            || step.is_multiple_of(measurement_interval(self.course.pace.last))
    }

    /// How many parts a step must be cut into, for the present speed.
    fn parts_needed(&self, next: Clock) -> Result<u64, StepError> {
        if !self.system.config.is_adaptive {
            return Ok(1);
        }
        let speed = self.system.flow.largest_speed();
        let StepLimit { length: limit, .. } = longest_step(&self.system.config, speed);
        let parts = (self.course.pace.time_step / limit - 1e-9).ceil().max(1.0);
        if parts <= PACING.most_parts {
            return Ok(parts as u64);
        }
        let (time_step, stable) = (self.course.pace.time_step, limit);
        Err(StepError::TimeStepFloor { speed, time_step, stable, step: next.step, time: next.time })
    }

    fn check(&mut self, next: Clock) -> Result<(), StepError> {
        let system = &self.system;
        check_finite_vectors("velocity", &system.flow.velocity, next)?;
        check_finite("density", &system.flow.density, next)?;
        first_broken(system.columns.find_broken(&system.particles), next)?;
        let Fastest { particle, speed, sound_speed } = fastest(system);
        self.max_cfl = self.max_cfl.max(speed * self.time_of_part() / system.config.spacing);
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
        if self.resting == PACING.steps_of_rest {
            let message = format!("no particle has been faster than {speed:.3e} for {} steps", PACING.steps_of_rest);
            self.course.findings.push(Finding::info("came_to_rest", message, (next.step, next.time)));
        }
        Ok(())
    }
}

/// The fastest particle.
struct Fastest {
    particle: usize,
    speed: f64,
    /// Speed of sound in its fluid.
    sound_speed: f64,
}

fn fastest<const D: usize>(system: &SphSystem<D>) -> Fastest {
    let mut fastest = (0, 0.0);
    for (i, u) in system.flow.velocity.iter().enumerate() {
        let square = u.norm_squared();
        if square > fastest.1 {
            fastest = (i, square);
        }
    }
    let (particle, speed) = (fastest.0, fastest.1.sqrt());
    Fastest { particle, speed, sound_speed: system.flow.fluid(particle).sound_speed }
}

fn failed(error: EvaluationError, at: Clock) -> StepError {
    match error {
        EvaluationError::Interrupted => StepError::Interrupted,
        EvaluationError::Lost => StepError::InterfaceLost { step: at.step, time: at.time },
    }
}

impl<const D: usize> Simulation for WeaklyCompressibleSph<D> {
    fn course(&self) -> &Course {
        &self.course
    }

    fn course_mut(&mut self) -> &mut Course {
        &mut self.course
    }

    fn is_finished(&self) -> bool {
        self.course.step >= self.course.pace.last || self.resting >= PACING.steps_of_rest
    }

    /// 1. The parts that the limits ask for. 2. Each part by the integrator. 3. A look at soundness and, where due, a row.
    fn step(&mut self) -> Result<(), StepError> {
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        let (start, next) = (self.clock(), self.course.next());
        self.parts_of_step = self.parts_needed(next)?;
        let part = self.time_of_part();
        for k in 0..self.parts_of_step {
            let time = start.time + k as f64 * part;
            let changed = self
                .stepper
                .advance(&mut self.system, time, part, &mut self.course.phases)
                .map_err(|error| failed(error, next))?;
            if let Some(droplets) = changed {
                let code = if droplets as f64 > self.summary.droplets { "split" } else { "merged" };
                let message = format!("there are {droplets} droplets now");
                let finding = Finding::info(code, message, (next.step, time + part));
                self.course.findings.push(finding.with_count(droplets as u64));
                self.summary.droplets = droplets as f64;
            }
        }
        self.check(next)?;
        self.course.step = next.step;
        if self.is_row_due(next.step) || self.is_finished() {
            self.take_row()?;
        }
        Ok(())
    }

    fn observables(&self) -> Observables {
        let mut row: Observables = vec![(&TIME, self.clock().time), (&TIME_STEP, self.time_of_part())];
        row.extend(names(D).into_iter().zip(self.row.iter().copied()));
        row
    }

    fn fields<'a>(&self, selection: Selection<'a>) -> Fields<'a> {
        frame_fields::frame(&self.system, selection)
    }

    fn save(&self, state: &mut Section) {
        let system = &self.system;
        self.course.save(state);
        state.put_section("pace", |section| {
            section.put_real("time_step", self.course.pace.time_step);
            section.put_component("origin", &self.course.pace.origin);
            section.put_count("parts_of_step", self.parts_of_step);
        });
        state.put_section("particles", |section| {
            save_particles(&system.particles, section);
            section.put_counts("phase", system.flow.species.iter().map(|species| u64::from(species.code())));
            section.put_vectors("velocity", &system.flow.velocity);
            section.put_vectors("acceleration", &system.rates.acceleration);
            section.put_vectors("reference", &system.pairs.lists.reference);
            section.put_reals("density", &system.flow.density);
            section.put_reals("density_rate", &system.rates.density);
        });
        state.put_section("droplets", |section| {
            section.put_flags("droplet", &system.droplets.label);
            section.put_reals("ball_curvatures", &system.droplets.ball_curvatures);
            section.put_optional("initial_measure", known(system.droplets.initial_measure));
        });
        if let Some(level_set) = system.interface.level_set() {
            state.put_section("interface", |section| {
                section.put_component("redistancing", level_set.surface.fit_diagnostics());
                section.put_count("bounded_curvatures", level_set.bounded);
                section.put_flags("candidate", &level_set.is_candidate);
            });
        }
        if let Some(flow) = system.equations.fits() {
            state.put_component("flow_fits", &flow.fit_diagnostics);
        }
        state.put_count("absorbed_strays", system.strays.absorbed);
        state.put_real("max_cfl", self.max_cfl);
        state.put_count("resting_steps", self.resting);
        state.put_section("row", |section| save_row::<D>(&self.row, section));
        state.put_component("summary", &self.summary);
    }

    fn load(&mut self, state: &Section) -> Result<(), LoadError> {
        // 1. Everything is read, and checked against this scene.
        let clock: Clock = state.component("clock")?;
        let (pace, parts_of_step) = state.section("pace", |section| {
            let (time_step, origin) = (section.real("time_step")?, section.component("origin")?);
            // Steps of another length begin at the restart.
            let is_same = time_step.to_bits() == self.course.pace.time_step.to_bits();
            let pace = Pace::new(self.course.pace.time_step, self.end_time, if is_same { origin } else { clock });
            Ok((pace, section.count("parts_of_step")?))
        })?;
        if clock.step > pace.last {
            return Err(LoadError::Beyond { step: clock.step, last: pace.last });
        }
        let interface = match self.system.interface.level_set() {
            Some(level_set) => Some(state.section("interface", |section| load_interface(level_set, section))?),
            None => None,
        };
        let flow_fits: Option<SupportDiagnostics> = match self.system.equations.fits() {
            Some(_) => Some(state.component("flow_fits")?),
            None => None,
        };
        let species = state.section("particles", species_of)?;
        let (absorbed, max_cfl) = (state.count("absorbed_strays")?, state.real("max_cfl")?);
        let (resting, row) = (state.count("resting_steps")?, state.section("row", load_row::<D>)?);
        let summary: Summary = state.component("summary")?;
        state.section("particles", |section| check_columns(&self.system, section))?;
        state.section("droplets", |section| check_droplets(&self.system, section))?;
        // 2. From here on nothing fails.
        state.section("particles", |section| load_columns(&mut self.system, section))?;
        state.section("droplets", |section| load_droplets(&mut self.system, section))?;
        let system = &mut self.system;
        system.flow.species = species;
        if let (Some((diagnostics, bounded, candidates)), Some(level_set)) =
            (interface, system.interface.level_set_mut())
        {
            *level_set.surface.fit_diagnostics_mut() = diagnostics;
            level_set.bounded = bounded;
            copy_flags(candidates, &mut level_set.is_candidate);
        }
        if let (Some(soundness), Some(flow)) = (flow_fits, system.equations.fits_mut()) {
            flow.fit_diagnostics = soundness;
        }
        system.strays.absorbed = absorbed;
        // An interrupt ends the run before its next step.
        let _ = system.derive();
        self.failure = None;
        (self.parts_of_step, self.max_cfl, self.resting) = (parts_of_step.max(1), max_cfl, resting);
        (self.row, self.summary) = (row, summary.with_end(self.end_time));
        self.course.pace = pace;
        self.course.findings.clear();
        self.course.step = clock.step;
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        let has = (self.system.interface.level_set().is_some(), self.system.equations.fits().is_some());
        format_1::translate(arrays, &self.system.particles, has)
    }

    fn report(&self) -> Report {
        let whole = self.whole_curvature();
        let expected = (self.system.config.tension * whole, whole, self.system.droplets.initial_measure);
        Report {
            errors: self.summary.entries(D, self.clock().time, expected),
            health: self.health(),
            diagnostics: self.diagnostics(),
            method: self.course.method.clone(),
        }
    }

    fn health(&self) -> Health {
        let volume_drift =
            self.summary.last_measure().map(|measure| measure / self.system.droplets.initial_measure - 1.0);
        let Fastest { speed, sound_speed, .. } = fastest(&self.system);
        let mut checks = vec![Check::at_most("mach", Some(speed / sound_speed), 1.0, "")];
        if self.system.interface.level_set().is_some() {
            checks.push(Check::watched(if D == 2 { "area_drift" } else { "volume_drift" }, volume_drift, ""));
            checks.push(Check::watched("absorbed_strays", Some(self.system.strays.absorbed as f64), "particles"));
        }
        let finite = self.system.flow.velocity.iter().all(is_finite);
        Health { finite, max_cfl: self.max_cfl, volume_drift, checks }
    }

    fn particle_count(&self) -> usize {
        self.system.particles.len()
    }
}

impl<const D: usize> WeaklyCompressibleSph<D> {
    fn diagnostics(&self) -> Vec<Diagnostic> {
        let mut diagnostics = Vec::new();
        if let Some(interface) = self.system.interface.level_set() {
            diagnostics.extend(closest_point_diagnostics(interface.surface.fit_diagnostics()));
            let doc = "Curvatures that were bounded to what the spacing resolves.";
            diagnostics.push(Diagnostic::count("curvature.clipped", interface.bounded, doc));
        }
        if let Some(flow) = self.system.equations.fits() {
            diagnostics.extend(support_diagnostics(FLOW_FITS, &flow.fit_diagnostics));
        }
        let doc = "Particles without a neighbor of their own fluid that took the side of their neighbors.";
        diagnostics.push(Diagnostic::count("strays.absorbed", self.system.strays.absorbed, doc));
        diagnostics
    }
}

/// The soundness of fits, the bounded curvatures and the candidates of a state.
fn load_interface<'a, const D: usize>(
    level_set: &LevelSet<D>,
    section: &'a Section,
) -> Result<(FitDiagnostics, u64, &'a [u64]), LoadError> {
    let candidates = section.counts_of("candidate", level_set.is_candidate.len())?;
    Ok((section.component("redistancing")?, section.count("bounded_curvatures")?, candidates))
}

/// The species of all particles.
fn species_of(section: &Section) -> Result<Vec<Species>, LoadError> {
    let unknown = || LoadError::Kind { name: "phase".to_owned(), expected: "0 or 1 everywhere" };
    section.counts("phase")?.iter().map(|code| Species::from_code(*code).ok_or_else(unknown)).collect()
}

/// Checks the columns of particles against this scene.
fn check_columns<const D: usize>(system: &SphSystem<D>, section: &Section) -> Result<(), LoadError> {
    let count = system.flow.count();
    check_particles(&system.particles, section)?;
    section.counts_of("phase", count)?;
    for name in ["velocity", "acceleration", "reference"] {
        section.reals_of(name, count * D)?;
    }
    section.reals_of("density", count)?;
    section.reals_of("density_rate", system.rates.density.len())?;
    Ok(())
}

/// Loads the columns of particles, as they were checked.
fn load_columns<const D: usize>(system: &mut SphSystem<D>, section: &Section) -> Result<(), LoadError> {
    load_particles(&mut system.particles, section)?;
    copy_vectors(section.reals("velocity")?, &mut system.flow.velocity);
    copy_vectors(section.reals("acceleration")?, &mut system.rates.acceleration);
    copy_vectors(section.reals("reference")?, &mut system.pairs.lists.reference);
    system.flow.density.copy_from_slice(section.reals("density")?);
    system.rates.density.copy_from_slice(section.reals("density_rate")?);
    Ok(())
}

/// Checks which particle belongs to which droplet.
fn check_droplets<const D: usize>(system: &SphSystem<D>, section: &Section) -> Result<(), LoadError> {
    section.counts_of("droplet", system.droplets.label.len())?;
    section.reals("ball_curvatures")?;
    section.optional("initial_measure").map(|_| ())
}

/// Loads which particle belongs to which droplet, as it was checked.
fn load_droplets<const D: usize>(system: &mut SphSystem<D>, section: &Section) -> Result<(), LoadError> {
    copy_flags(section.counts("droplet")?, &mut system.droplets.label);
    system.droplets.ball_curvatures = section.reals("ball_curvatures")?.to_vec();
    system.droplets.initial_measure = section.optional("initial_measure")?.unwrap_or(f64::NAN);
    Ok(())
}

fn copy_flags(from: &[u64], to: &mut [u8]) {
    for (flag, count) in to.iter_mut().zip(from) {
        *flag = (*count).min(255) as u8;
    }
}

#[cfg(test)]
mod tests;
