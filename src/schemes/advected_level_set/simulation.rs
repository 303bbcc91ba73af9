//! Transport and redistancing step by step.

use super::enclosed_watch::{Enclosed, EnclosedWatch};
use super::errors::{DistanceErrors, MeasuredErrors};
use super::format_1;
use super::frame_fields;
use super::quantities::{AREA, BAND_PARTICLES, CFL, RESCUED_FITS, TIME, TIME_STEP, VOLUME, VOLUME_DRIFT};
use super::reach_watch::ReachWatch;
use super::system::{AdvectedSystem, Copied, FieldChoice, RedistanceWhen};
use crate::closest_point::enclosed_moments::enclosed_area_or_volume;
use crate::closest_point::{Coverage, FitDiagnostics, LevelSurface};
use crate::geometry::Vector;
use crate::parallel::Interrupted;
use crate::particles::Particles;
use crate::schemes::flow_divergence::divergence_diagnostic;
use crate::schemes::measured_errors::{ErrorNorms, closest_point_diagnostics, rescued};
use crate::simulation::components::{load_particles, save_particles};
use crate::simulation::course::{check_finite_vectors, first_broken, is_finite};
use crate::simulation::fields::SURFACE_FIELDS;
use crate::simulation::{
    Course, CpuClock, Fields, Health, LoadError, Observables, OutputPlan, Phases, Report, Section, Selection,
    Simulation, StepError,
};
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

/// An advected level set as a simulation.
pub struct AdvectedLevelSet<const D: usize> {
    system: AdvectedSystem<D>,
    plan: OutputPlan,
    /// Step of the last redistancing; the start counts as one, since its distances are exact.
    redistanced: Option<u64>,
    /// Enclosed area or volume when it was last measured, and the step of that.
    measure: f64,
    measured: u64,
    /// Enclosed area or volume at time 0.
    initial_measure: f64,
    /// Share of the particles inside at time 0.
    initial_inside_share: f64,
    /// Whether the flow keeps the area or volume.
    keeps_volume: bool,
    enclosed_watch: EnclosedWatch,
    reach_watch: ReachWatch,
    max_cfl: f64,
    errors: Vec<MeasuredErrors>,
    course: Course,
}

impl<const D: usize> AdvectedLevelSet<D> {
    /// A simulation at time 0.
    #[must_use]
    pub fn new(
        system: AdvectedSystem<D>,
        fixed: FixedStep,
        plan: OutputPlan,
        cpu_clock: CpuClock,
        method: BTreeMap<&'static str, String>,
    ) -> Self {
        // Of a surface that is known by its particles alone, the first quadrature says what is to be kept.
        let measure = system.motion.surface().map_or_else(
            || {
                let copy = system.redistanced_copy(&system.interrupt);
                // An interrupt ends the run before its first step.
                copy.and_then(|copy| enclosed_area_or_volume(&copy.surface, &system.interrupt)).unwrap_or(f64::NAN)
            },
            crate::geometry::Surface::area_or_volume,
        );
        // What points from elsewhere bring is a level, and no distance yet.
        let redistanced = system.motion.surface().map(|_| 0);
        let (low, high) = box_of(system.particles.positions());
        Self {
            initial_inside_share: system.inside_share(),
            keeps_volume: system.motion.flow().keeps_volume(&low, &high),
            system,
            plan,
            redistanced,
            initial_measure: measure,
            measure,
            measured: 0,
            enclosed_watch: EnclosedWatch::default(),
            reach_watch: ReachWatch::default(),
            max_cfl: 0.0,
            errors: Vec::new(),
            course: Course::new(fixed.into(), Phases::new(cpu_clock), method),
        }
    }

    /// Whether the step that ends at `step` redistances the particles themselves. On a schedule only the schedule does,
    /// since a redistancing leaves its distances or normals to the next: what output asks for in between is taken on a
    /// copy and never becomes physics. Without a schedule nothing is left to anybody, so output may redistance.
    fn is_redistancing_due(&self, step: u64) -> bool {
        match self.system.parts.when {
            RedistanceWhen::ForOutput => {
                step >= self.course.pace.last
                    || self.is_error_due(step)
                    || self.plan.is_frame_due(&self.course.fixed(), step)
            }
            RedistanceWhen::Every(every) => step.is_multiple_of(every),
        }
    }

    /// Errors are taken half way through a flow that returns, and at the end.
    fn is_error_due(&self, step: u64) -> bool {
        let halfway =
            self.system.motion.flow().return_time().is_some_and(|t| self.course.fixed().reaches(step, 0.5 * t));
        step >= self.course.pace.last || halfway
    }

    /// Errors of particles and surface against the exact motion.
    fn measure_errors(
        &self,
        time: f64,
        particles: &Particles<D>,
        surface: &LevelSurface<D>,
        measure: f64,
    ) -> Result<MeasuredErrors, Interrupted> {
        let system = &self.system;
        let exact = self.initial_measure;
        let measure_relative = (measure - exact).abs() / exact;
        let Some(front) = system.motion.front(time, system.parts.spacing, &system.interrupt)? else {
            return Ok(MeasuredErrors { time, measure_relative, distances: None });
        };
        let interrupt = &system.interrupt;
        let band = particles.flag(system.columns.in_band);
        let phi = particles.scalar(system.columns.phi);
        let in_band: Vec<usize> = (0..particles.len()).filter(|&i| band[i] == 1).collect();
        let places: Vec<Vector<D>> = in_band.iter().map(|&i| particles.positions()[i]).collect();
        let mut norms = ErrorNorms::default();
        for (i, distance) in in_band.into_iter().zip(front.signed_distances(&places, interrupt)?) {
            norms.add(phi[i] - distance);
        }
        let (samples_mean, samples_max) = mean_and_max(&front.signed_distances(&surface.sample_points(), interrupt)?);
        interrupt.check()?;
        // Over an empty band there is no error, which is not an error of zero.
        let distances = (!norms.is_empty()).then(|| DistanceErrors {
            phi_rms: norms.rms(),
            phi_max: norms.max(),
            samples_mean,
            samples_max,
        });
        Ok(MeasuredErrors { time, measure_relative, distances })
    }

    /// Relative change of the enclosed area or volume when it was last measured.
    fn drift(&self) -> f64 {
        (self.measure - self.initial_measure) / self.initial_measure
    }

    /// What is watched of the area or volume inside, and its relative change.
    fn enclosed(&self) -> (Enclosed, f64) {
        match self.system.parts.field {
            FieldChoice::Dual => (Enclosed::surface::<D>(), self.drift()),
            FieldChoice::Overwrite => {
                (Enclosed::particles(), self.system.inside_share() / self.initial_inside_share - 1.0)
            }
        }
    }

    /// Looks at the enclosed area or volume that was just measured.
    fn watch_enclosed(&mut self, now: Clock) -> Result<(), StepError> {
        if self.keeps_volume {
            let (enclosed, drift) = self.enclosed();
            self.course.findings.extend(self.enclosed_watch.look(&enclosed, drift, now)?);
        }
        Ok(())
    }

    /// Looks at the answers of a redistancing.
    fn watch_reach(&mut self, coverage: Coverage, now: Clock) -> Result<(), StepError> {
        let found = self.reach_watch.look(coverage, now)?;
        self.course.findings.extend(found);
        Ok(())
    }

    /// Takes the errors of this moment: of the particles as they are where they were just redistanced, else of a copy,
    /// so that asking for an error never becomes part of the physics.
    fn take_errors(&mut self, now: Clock) -> Result<(), StepError> {
        let start = (self.course.phases.clock())();
        let measured = if self.redistanced == Some(now.step) {
            self.measure_errors(now.time, &self.system.particles, &self.system.redistancing, self.measure)?
        } else {
            let Copied { particles, surface, coverage } = self.system.redistanced_copy(&self.system.interrupt)?;
            if surface.is_lost() {
                return Err(StepError::InterfaceLost { step: now.step, time: now.time });
            }
            let measure = enclosed_area_or_volume(&surface, &self.system.interrupt)?;
            let measured = self.measure_errors(now.time, &particles, &surface, measure)?;
            // From here on nothing is interrupted. What the copy could not do the plain way stands behind the errors that are
            // reported.
            self.system.redistancing.fit_diagnostics_mut().merge(surface.fit_diagnostics());
            (self.measure, self.measured) = (measure, now.step);
            self.watch_enclosed(now)?;
            self.watch_reach(coverage, now)?;
            measured
        };
        self.errors.push(measured);
        let spent = (self.course.phases.clock())() - start;
        self.course.phases.book("errors", spent);
        Ok(())
    }
}

/// Lower and upper corner of the box about points.
fn box_of<const D: usize>(points: &[Vector<D>]) -> (Vector<D>, Vector<D>) {
    let nothing = (Vector::<D>::repeat(f64::INFINITY), Vector::<D>::repeat(f64::NEG_INFINITY));
    points.iter().fold(nothing, |(low, high), x| (low.inf(x), high.sup(x)))
}

/// Mean and largest of |distance|; a NaN is not hidden.
fn mean_and_max(distances: &[f64]) -> (f64, f64) {
    // `f64::max` would drop a NaN.
    let has_nan = distances.iter().any(|distance| distance.is_nan());
    let max = if has_nan { f64::NAN } else { distances.iter().fold(0.0_f64, |max, distance| max.max(distance.abs())) };
    (distances.iter().map(|distance| distance.abs()).sum::<f64>() / distances.len().max(1) as f64, max)
}

impl<const D: usize> Simulation for AdvectedLevelSet<D> {
    fn course(&self) -> &Course {
        &self.course
    }

    fn course_mut(&mut self) -> &mut Course {
        &mut self.course
    }

    /// 1. Transport: positions move, ψ stays with them.
    /// 2. Redistancing, on the scene's schedule or, without one, where output needs it.
    /// 3. The enclosed measure for a due series row. Errors half way and at the end are a measurement.
    fn advance(&mut self) -> Result<(), StepError> {
        let before = self.clock();
        let next = self.course.next();
        let (system, time_step) = (&mut self.system, self.course.pace.time_step);
        let way = self.course.phases.measure("advection", || system.advect(before.time, time_step));
        let way = way.map_err(|error| StepError::from_path(error, next))?;
        check_finite_vectors("position", self.system.particles.positions(), next)?;
        self.max_cfl = self.max_cfl.max(way);
        if self.is_redistancing_due(next.step) {
            self.system.redistance(&mut self.course.phases)?;
            if self.system.redistancing.is_lost() {
                return Err(StepError::InterfaceLost { step: next.step, time: next.time });
            }
            first_broken(self.system.columns.find_broken(&self.system.particles), next)?;
            self.redistanced = Some(next.step);
            self.watch_reach(self.system.coverage(), next)?;
            let is_row_due = self.plan.is_series_due(&self.course.fixed(), next.step);
            // What is redistanced for output alone is rare enough to be watched each time.
            let is_for_output = self.system.parts.when == RedistanceWhen::ForOutput;
            if self.is_error_due(next.step) || is_row_due || is_for_output {
                let system = &self.system;
                self.measure = self
                    .course
                    .phases
                    .measure("measure", || enclosed_area_or_volume(&system.redistancing, &system.interrupt))?;
                self.measured = next.step;
                self.watch_enclosed(next)?;
            }
        }
        self.course.step = next.step;
        Ok(())
    }

    fn is_measurement_due(&self) -> bool {
        let Clock { step, time } = self.clock();
        step > 0 && self.is_error_due(step) && self.errors.last().is_none_or(|last| last.time != time)
    }

    fn measure(&mut self) -> Result<(), StepError> {
        self.take_errors(self.clock())
    }

    fn observables(&self) -> Observables {
        let step = self.course.step;
        let band = self.system.particles.flag(self.system.columns.in_band);
        // Between redistancings the surface is not known, and a stale number would look like knowledge.
        let known = |fresh: bool, value: f64| if fresh { value } else { f64::NAN };
        let is_measured = self.measured == step;
        let in_band = known(self.redistanced == Some(step), band.iter().map(|b| f64::from(*b)).sum());
        vec![
            (&TIME, self.clock().time),
            (&TIME_STEP, self.course.pace.time_step),
            (if D == 2 { &AREA } else { &VOLUME }, known(is_measured, self.measure)),
            (&VOLUME_DRIFT, known(is_measured, self.drift())),
            (&BAND_PARTICLES, in_band),
            (&CFL, self.max_cfl),
            (&RESCUED_FITS, rescued(&self.system.redistancing.fit_diagnostics().counts) as f64),
        ]
    }

    fn fields<'a>(&self, selection: Selection<'a>) -> Fields<'a> {
        let shows_surface = SURFACE_FIELDS.iter().any(|quantity| selection.has(quantity));
        let fresh;
        let particles = if self.redistanced == Some(self.course.step) || !shows_surface {
            &self.system.particles
        } else {
            // An interrupted frame is dropped by its writer.
            match self.system.redistanced_copy(&self.system.interrupt) {
                Ok(copy) => {
                    fresh = copy.particles;
                    &fresh
                }
                Err(Interrupted) => &self.system.particles,
            }
        };
        frame_fields::frame(&self.system, particles, self.clock().time, selection)
    }

    fn save(&self, state: &mut Section) {
        self.course.save(state);
        state.put_section("particles", |section| save_particles(&self.system.particles, section));
        state.put_component("redistancing", self.system.redistancing.fit_diagnostics());
        state.put_optional_count("redistanced_at_step", self.redistanced);
        state.put_section("enclosed_measure", |section| {
            section.put_real("value", self.measure);
            section.put_count("at_step", self.measured);
        });
        state.put_real("max_cfl", self.max_cfl);
        state.put_list("errors", &self.errors);
        self.enclosed_watch.save(state);
        self.reach_watch.save(state);
    }

    fn load(&mut self, state: &Section) -> Result<(), LoadError> {
        let clock = self.course.check(state)?;
        let soundness: FitDiagnostics = state.component("redistancing")?;
        let redistanced = state.optional_count("redistanced_at_step")?;
        let (measure, measured) =
            state.section("enclosed_measure", |section| Ok((section.real("value")?, section.count("at_step")?)))?;
        let (max_cfl, errors) = (state.real("max_cfl")?, state.list("errors")?);
        let (enclosed_watch, reach_watch) = (EnclosedWatch::load(state)?, ReachWatch::load(state)?);
        state.section("particles", |section| load_particles(&mut self.system.particles, section))?;
        // From here on nothing fails.
        *self.system.redistancing.fit_diagnostics_mut() = soundness;
        (self.redistanced, self.measure, self.measured) = (redistanced, measure, measured);
        (self.max_cfl, self.errors) = (max_cfl, errors);
        (self.enclosed_watch, self.reach_watch) = (enclosed_watch, reach_watch);
        self.course.step = clock.step;
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        format_1::translate(arrays, &self.system.particles)
    }

    fn report(&self) -> Report {
        Report {
            errors: self.errors.iter().flat_map(|e| e.entries(D)).collect(),
            health: self.health(),
            diagnostics: {
                let (system, time) = (&self.system, self.clock().time);
                let mut diagnostics = closest_point_diagnostics(system.redistancing.fit_diagnostics());
                diagnostics.extend(divergence_diagnostic(system.motion.flow(), system.particles.positions(), time));
                diagnostics
            },
            method: self.course.method.clone(),
        }
    }

    fn health(&self) -> Health {
        let volume_drift = Some(self.drift());
        let (enclosed, drift) = self.enclosed();
        let mut checks = vec![enclosed.check(Some(drift), self.keeps_volume)];
        checks.extend(self.reach_watch.checks());
        Health {
            finite: self.system.particles.positions().iter().all(is_finite),
            max_cfl: self.max_cfl,
            volume_drift,
            checks,
        }
    }

    fn particle_count(&self) -> usize {
        self.system.particles.len()
    }
}
