//! Two fluids step by step.

use super::checks::{LIMITS, WALL_DEPTH};
use super::diagnostics::diagnostics;
use super::droplets::ball_curvature;
use super::fastest::{Fastest, fastest};
use super::format_1;
use super::frame_fields;
use super::guard::Guard;
use super::monitors::{Row, deformation, load_row, names, save_row};
use super::pacing::{PACING, measurement_interval};
use super::quantities::{TIME, TIME_STEP, WAVE_AMPLITUDE};
use super::shear_record::ShearRecord;
use super::stepping::Stepper;
use super::summary::Summary;
use super::system::{EvaluationError, Instant, SphSystem};
use super::tension_law::TensionLaw;
use super::tension_record::TensionRecord;
use super::time_step::{StepLimit, longest_step};
use super::varying_tension::VaryingTension;
use super::wall_record::WallRecord;
use super::wave_record::WaveRecord;
use crate::geometry::Vector;
use crate::schemes::measured_errors::entry;
use crate::simulation::course::{check_finite, check_finite_vectors, first_broken, is_finite};
use crate::simulation::{
    Check, Course, CpuClock, Divergence, ErrorEntry, Fields, Finding, Health, LoadError, Observables, OutputPlan,
    Phases, Region, Report, Section, Selection, Simulation, StepError,
};
use crate::time::clock::TIME_SLACK;
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
    guard: Guard<D>,
    summary: Summary,
    wave: Option<WaveRecord>,
    tension: Option<TensionRecord<D>>,
    walls: Option<WallRecord>,
    shear: Option<ShearRecord>,
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
        let wave = system.config.wave.clone().map(WaveRecord::new);
        let has_surfactant = matches!(system.config.tension_law, Some(TensionLaw::Surfactant(_)));
        let tension = system.varying.as_ref().map(|_| TensionRecord::new(has_surfactant, end_time));
        let walls = system.walls.as_ref().map(|_| WallRecord::UNKNOWN);
        let shear = system.config.mean_shear.map(|_| ShearRecord::UNKNOWN);
        let mut this = Self {
            failure: None,
            stepper: Stepper::new(&system.config, system.flow.count()),
            guard: Guard::new(&system),
            system,
            plan,
            end_time,
            parts_of_step: 1,
            max_cfl: 0.0,
            resting: 0,
            row: Row::new(),
            summary: Summary::new(end_time),
            wave,
            tension,
            walls,
            shear,
            course: Course::new(pace, Phases::new(cpu_clock), method),
        };
        this.failure = this.begin().err();
        this
    }

    fn begin(&mut self) -> Result<(), StepError> {
        let start = Clock { step: 0, time: 0.0 };
        // A row of the right length, whatever happens.
        self.row = vec![f64::NAN; names(D).len()];
        let instant = Instant::default();
        self.system.evaluate(instant, &mut self.course.phases).map_err(|error| failed(error, start))?;
        if self.system.droplets.initial_measure.is_nan() && self.system.config.has_tension() {
            // Of a drop that is known by its particles alone, the first measurement says what is to be kept.
            let moments = self.system.moments()?;
            self.system.droplets.initial_measure = match &moments {
                Some(_) => self.system.enclosed_measure(moments.as_ref()),
                None => self.system.volume_inside(),
            };
            self.system.droplets.renew_ball_curvatures();
            self.system.evaluate(instant, &mut self.course.phases).map_err(|error| failed(error, start))?;
        }
        if self.system.calibrate()? {
            self.system.evaluate(instant, &mut self.course.phases).map_err(|error| failed(error, start))?;
        }
        self.summary.droplets = self.system.droplets.number() as f64;
        self.guard = Guard::new(&self.system);
        self.take_row()
    }

    /// κ₀ of one droplet that holds everything, as a ball or, on a wall, as a cap.
    fn whole_curvature(&self) -> f64 {
        match self.system.droplets.ball_curvatures.as_slice() {
            [cap] if self.system.droplets.has_contact() => *cap,
            _ => ball_curvature::<D>(self.system.droplets.initial_measure),
        }
    }

    /// Mean tension over the interface.
    fn mean_tension(&self) -> f64 {
        let tension = self.system.config.tension;
        self.system.varying.as_ref().map_or(tension, VaryingTension::mean)
    }

    fn time_of_part(&self) -> f64 {
        self.course.pace.time_step / self.parts_of_step as f64
    }

    /// Takes a row, and what the summary wants of it.
    fn take_row(&mut self) -> Result<(), StepError> {
        let time_step = self.time_of_part();
        let system = &self.system;
        let moments = self.course.phases.measure("measure", || system.moments())?;
        let contents = system.contents();
        let (row, crowded) = self.course.phases.measure("measure", || {
            let supply = (&contents, self.guard.budget.work);
            system.row(time_step, moments.as_ref(), supply, LIMITS.pair_distance)
        });
        self.row = row;
        let Clock { step, time } = self.clock();
        if let Some(shear) = &mut self.shear {
            shear.take(system, moments.as_ref(), time);
        }
        self.summary.take_energy(time, contents.inner_kinetic());
        let of = |name: &str| self.row_value(name);
        let jump = of("pressure_inside") - of("pressure_outside");
        let momentum = self.row[1..=D].iter().map(|m| m * m).sum::<f64>().sqrt();
        let jumps = [jump, of("pressure_eos_jump"), of("pressure_jump_measured"), of("pressure_balanced")];
        let curvatures = [of("curvature_mean"), of("curvature_std")];
        self.summary.take(time >= 0.8 * self.end().time, jumps, curvatures, momentum);
        let is_closed = !system.droplets.has_layer();
        if let Some(moments) = moments.filter(|_| is_closed) {
            let turned = self.summary.take_shape(time, moments.area_or_volume, deformation(&moments));
            if let Some((code, message)) = turned {
                self.course.findings.push(Finding::info(code, message, (step, time)));
            }
        }
        // At fixed steps, so that the end of a run does not depend on what the series shows.
        let clock = self.clock();
        let last = self.course.pace.last;
        let is_measured = clock.step.is_multiple_of(measurement_interval(last)) || clock.step >= last;
        if let Some(wave) = &mut self.wave {
            wave.take(&self.system, time, is_measured);
        }
        if let (Some(record), Some(varying)) = (&mut self.tension, &self.system.varying) {
            record.take(&self.system, varying);
        }
        let circularity = self.row_value("circularity");
        if let Some(walls) = &mut self.walls {
            walls.take(&self.system, &self.system.moment(time), circularity);
        }
        if is_measured {
            self.summary.largest_speed = self.summary.largest_speed.max(self.system.flow.largest_relative_speed());
            let measured = (crowded, self.row_value(if D == 2 { "area" } else { "volume" }));
            self.guard.measure(&self.system, &contents, measured, clock)?;
            let center = Vector::<D>::from_fn(|d, _| self.row_value(["center_x", "center_y", "center_z"][d]));
            if let Some(record) = &mut self.tension {
                self.course.findings.extend(record.measure(&self.system, &center, clock)?);
            }
            let Fastest { speed, sound_speed, .. } = fastest(&self.system);
            self.course.findings.extend(self.guard.new_doubts(&self.system, speed / sound_speed, clock));
        }
        Ok(())
    }

    /// The largest speed u about the mean velocity as u √(ρD/τ), with the diameter D of the ball of the measure at the start.
    fn scaled_speed(&self) -> Option<ErrorEntry> {
        if self.system.droplets.has_layer() {
            return None;
        }
        let diameter = 2.0 * (D - 1) as f64 / self.whole_curvature();
        let config = &self.system.config;
        let scaled = self.system.flow.largest_relative_speed()
            * (config.fluids.inside.density * diameter / config.tension).sqrt();
        let reference = "0 for a drop at rest; u sqrt(rho D/tau), u about the mean velocity";
        scaled.is_finite().then(|| entry("speed", "scaled", scaled, self.clock().time, reference))
    }

    /// The steps of a run that goes on at a clock, after steps of a length since `origin` to an end.
    ///
    /// Steps that the scene chose go on as they were; to another end they are as long as lands on it. Of steps that were given,
    /// those of another length begin at the restart.
    fn pace_after(&self, clock: Clock, (time_step, origin): (f64, Clock), end_time: f64) -> Pace {
        if self.system.config.is_adaptive {
            if end_time.to_bits() == self.end_time.to_bits() {
                return Pace::new(time_step, self.end_time, origin);
            }
            let left = self.end_time - clock.time;
            let length = if left > 0.0 { left / (left / time_step - TIME_SLACK).ceil().max(1.0) } else { time_step };
            return Pace::new(length, self.end_time, clock);
        }
        let given = self.course.pace.time_step;
        let is_same = time_step.to_bits() == given.to_bits();
        Pace::new(given, self.end_time, if is_same { origin } else { clock })
    }

    /// A number of the row; NaN without one.
    fn row_value(&self, name: &str) -> f64 {
        names(D).iter().position(|quantity| quantity.name == name).map_or(f64::NAN, |k| self.row[k])
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
        check_finite_vectors("velocity", &system.flow.velocity, next).map_err(|error| system.explained(error, next))?;
        check_finite("density", &system.flow.density, next)?;
        first_broken(system.columns.find_broken(&system.particles), next)?;
        if let (Some(record), Some(varying)) = (&mut self.tension, &system.varying) {
            record.check_step(system, varying, next)?;
        }
        if let Some(value) = system.depth_in_walls().filter(|depth| *depth > LIMITS.wall_depth) {
            let (limit, Clock { step, time }) = (LIMITS.wall_depth, next);
            return Err(StepError::CheckFailed {
                check: WALL_DEPTH,
                divergence: Divergence::Escaped,
                value,
                limit,
                step,
                time,
            });
        }
        let largest_speed = system.flow.largest_speed();
        let Fastest { particle, speed, sound_speed } = fastest(system);
        self.max_cfl = self.max_cfl.max(largest_speed * self.time_of_part() / system.config.spacing);
        if speed > sound_speed {
            // What would have held at the speeds that a sound run has.
            let StepLimit { length: stable, cause: bound } = longest_step(&system.config, system.config.expected_speed);
            let time_step = self.time_of_part();
            let Clock { step, time } = next;
            return Err(StepError::TooFast { particle, speed, sound_speed, time_step, stable, bound, step, time });
        }
        // In the frame of the start.
        let about_start = system.flow.largest_speed_about(&system.config.start_velocity);
        self.resting = match system.config.rest_below {
            Some(limit) if about_start < limit => self.resting + 1,
            _ => 0,
        };
        if self.resting == PACING.steps_of_rest {
            let message =
                format!("no particle has been faster than {about_start:.3e} for {} steps", PACING.steps_of_rest);
            self.course.findings.push(Finding::info("came_to_rest", message, (next.step, next.time)));
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
    fn advance(&mut self) -> Result<(), StepError> {
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
            self.guard.advance(&self.system, time + part, part, changed.is_some());
        }
        self.guard.count_step(&self.system);
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
        row.extend(self.wave.as_ref().map(|wave| (&WAVE_AMPLITUDE, wave.amplitude)));
        row.extend(self.tension.iter().flat_map(TensionRecord::observables));
        row.extend(self.walls.iter().flat_map(WallRecord::observables));
        row.extend(self.shear.iter().flat_map(ShearRecord::observables));
        row
    }

    fn fields<'a>(&self, selection: Selection<'a>) -> Fields<'a> {
        frame_fields::frame(&self.system, selection)
    }

    fn save(&self, state: &mut Section) {
        self.course.save(state);
        state.put_section("pace", |section| {
            section.put_real("time_step", self.course.pace.time_step);
            section.put_component("origin", &self.course.pace.origin);
            section.put_count("parts_of_step", self.parts_of_step);
        });
        state.put_section("guard", |section| self.guard.save(section));
        self.system.save(state);
        state.put_real("max_cfl", self.max_cfl);
        state.put_count("resting_steps", self.resting);
        state.put_section("row", |section| save_row::<D>(&self.row, section));
        state.put_component("summary", &self.summary);
        if let Some(wave) = &self.wave {
            state.put_section("wave", |section| wave.save(section));
        }
        if let Some(tension) = &self.tension {
            state.put_section("tension", |section| tension.save(section));
        }
        if let Some(walls) = &self.walls {
            state.put_component("walls", walls);
        }
        if let Some(shear) = &self.shear {
            state.put_component("shear", shear);
        }
    }

    fn load(&mut self, state: &Section) -> Result<(), LoadError> {
        // 1. Everything is read, and checked against this scene.
        let clock: Clock = state.component("clock")?;
        let summary: Summary = state.component("summary")?;
        let (pace, parts_of_step) = state.section("pace", |section| {
            let (time_step, origin) = (section.real("time_step")?, section.component("origin")?);
            let pace = self.pace_after(clock, (time_step, origin), summary.late.end_time);
            Ok((pace, section.count("parts_of_step")?))
        })?;
        if clock.step > pace.last {
            return Err(LoadError::Beyond { step: clock.step, last: pace.last });
        }
        let max_cfl = state.real("max_cfl")?;
        let (resting, row) = (state.count("resting_steps")?, state.section("row", load_row::<D>)?);
        // A state of version 0.2.0 has no guard: its budgets begin at the restart.
        let guard = match state.has("guard") {
            true => Some(state.section("guard", |section| self.guard.load(section))?),
            false => None,
        };
        let wave = match &self.wave {
            Some(wave) => Some(state.section("wave", |section| wave.load(section))?),
            None => None,
        };
        let tension = match &self.tension {
            Some(tension) => Some(state.section("tension", |section| tension.load(section))?),
            None => None,
        };
        let walls = match self.walls {
            Some(_) => Some(state.component("walls")?),
            None => None,
        };
        let shear = match self.shear {
            Some(_) => Some(state.component("shear")?),
            None => None,
        };
        self.system.load(state)?;
        // 2. From here on nothing fails.
        // An interrupt ends the run before its next step.
        let _ = self.system.derive();
        self.system.slide_images(clock.time);
        self.guard = guard.unwrap_or_else(|| Guard::new(&self.system));
        (self.failure, self.wave, self.tension, self.walls, self.shear) = (None, wave, tension, walls, shear);
        (self.parts_of_step, self.max_cfl, self.resting) = (parts_of_step.max(1), max_cfl, resting);
        (self.row, self.summary) = (row, summary.with_end(self.end_time));
        self.course.pace = pace;
        self.course.findings.clear();
        self.course.step = clock.step;
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        let has = (self.system.interface.level_set().is_some(), self.system.equations.fits().is_some());
        format_1::translate(arrays, &self.system.particles, &self.guard, has)
    }

    fn report(&self) -> Report {
        let whole = self.whole_curvature();
        let measure = self.system.droplets.initial_measure;
        let expected = match self.system.droplets.has_layer() {
            false => (self.mean_tension() * whole, whole, measure),
            // A layer has no curvature as a ball.
            true => (f64::NAN, f64::NAN, measure),
        };
        let mut errors = self.summary.entries(D, self.clock().time, expected);
        errors.extend(self.scaled_speed());
        errors.extend(self.guard.energy_rise(&self.system, self.clock().time));
        errors.extend(self.tension.iter().flat_map(|record| record.errors(&self.system, measure, self.clock().time)));
        errors.extend(self.wave.iter().flat_map(|wave| wave.errors(self.clock().time)));
        errors.extend(self.walls.iter().flat_map(|walls| walls.errors(&self.system, self.clock().time)));
        errors.extend(self.shear.iter().flat_map(|shear| shear.errors(&self.system, self.clock().time)));
        Report {
            errors,
            health: self.health(),
            diagnostics: diagnostics(&self.system, self.summary.largest_speed),
            method: self.course.method.clone(),
        }
    }

    fn health(&self) -> Health {
        let volume_drift =
            self.summary.last_measure().map(|measure| measure / self.system.droplets.initial_measure - 1.0);
        let Fastest { speed, sound_speed, .. } = fastest(&self.system);
        let mut checks = vec![Check::at_most("mach", Some(speed / sound_speed), 1.0, "")];
        checks.extend(self.guard.checks(&self.system));
        checks.extend(self.tension.iter().flat_map(TensionRecord::checks));
        let depth = self.system.depth_in_walls();
        checks.extend(depth.map(|depth| Check::at_most(WALL_DEPTH, Some(depth), LIMITS.wall_depth, "spacings")));
        if self.system.interface.level_set().is_some() {
            checks.push(Check::watched(if D == 2 { "area_drift" } else { "volume_drift" }, volume_drift, ""));
            checks.push(Check::watched("absorbed_strays", Some(self.system.strays.absorbed as f64), "particles"));
        }
        let finite = self.system.flow.velocity.iter().all(is_finite);
        Health { finite, max_cfl: self.max_cfl, volume_drift, checks }
    }

    fn weights(&self, region: Region) -> Option<Vec<f64>> {
        self.system.weights(region)
    }

    fn particle_count(&self) -> usize {
        self.system.particles.len()
    }
}

#[cfg(test)]
mod tests;
