//! One step a redistancing: the distances of one are the input of the next.

use super::checks::Watched;
use super::errors::errors;
use super::format_1;
use super::quantities::{PHI_ERROR_MAX, PHI_ERROR_RMS, RESCUED_FITS, TIME};
use super::system::{Source, StaticSystem};
use crate::closest_point::{Coverage, FitDiagnostics};
use crate::parallel::Interrupt;
use crate::schemes::measured_errors::{closest_point_diagnostics, rescued};
use crate::schemes::measured_redistancing::{query, rebuild};
use crate::simulation::components::{load_particles, save_particles};
use crate::simulation::course::first_broken;
use crate::simulation::{
    Course, CpuClock, ErrorEntry, Fields, Health, LoadError, Observables, OutputPlan, Phases, Report, Section,
    Selection, Simulation, StepError,
};
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

/// A static redistancing as a simulation; scene time counts redistancings.
pub struct StaticRedistancing<const D: usize> {
    system: StaticSystem<D>,
    course: Course,
    plan: OutputPlan,
    /// Errors that were measured last, with their step.
    measured: Option<(u64, Vec<ErrorEntry>)>,
    watched: Watched,
    /// Distance of each particle at the last redistancing, without sign; NaN without an answer.
    distances: Vec<f64>,
}

impl<const D: usize> StaticRedistancing<D> {
    /// A simulation at its start.
    #[must_use]
    pub fn new(system: StaticSystem<D>, cpu_clock: CpuClock, method: BTreeMap<&'static str, String>) -> Self {
        let fixed = FixedStep { time_step: 1.0, steps: system.repeats };
        let course = Course::new(fixed.into(), Phases::new(cpu_clock), method);
        let plan = OutputPlan { every_time: None, series_every_steps: 1 };
        Self { system, course, plan, measured: None, watched: Watched::default(), distances: Vec::new() }
    }

    /// Compares the answers of a step with the particles that they are made of.
    fn check(&mut self) -> Result<(), StepError> {
        let StaticSystem { redistancing: surface, answers, particles, source, .. } = &self.system;
        let coverage = Coverage::new(surface, answers, particles.len());
        let crossings = match source {
            Source::Particles => {
                self.distances.clear();
                self.distances.resize(particles.len(), f64::NAN);
                answers.iter().for_each(|(i, answer)| self.distances[i] = answer.distance);
                let distance = |i: usize| Some(self.distances[i]).filter(|distance| distance.is_finite());
                surface.crossings(particles.positions(), distance)
            }
            Source::Others { positions, .. } => surface
                .crossings(positions, |i| surface.query(&positions[i], f64::INFINITY).map(|answer| answer.distance)),
            // The surface of a grid is that of its nodes, not of the particles.
            Source::Grid(_) => None,
        };
        let before = std::mem::replace(&mut self.watched, Watched::new(coverage, crossings));
        let doubts = self.watched.judge(&before, self.course.next())?;
        self.course.findings.extend(doubts);
        Ok(())
    }

    /// The same with the plan of its output.
    #[must_use]
    pub fn with_plan(mut self, plan: OutputPlan) -> Self {
        self.plan = plan;
        self
    }

    /// Errors of the present state: those that were measured, or else computed now.
    fn errors(&self) -> Vec<ErrorEntry> {
        match &self.measured {
            Some((step, errors)) if *step == self.course.step => errors.clone(),
            // Without an interrupt nothing fails.
            _ => errors(&self.system, self.clock(), &Interrupt::default()).unwrap_or_default(),
        }
    }
}

impl<const D: usize> Simulation for StaticRedistancing<D> {
    fn course(&self) -> &Course {
        &self.course
    }

    fn course_mut(&mut self) -> &mut Course {
        &mut self.course
    }

    /// 1. Detection, regression and projection from the present level, or from what a grid gets of it.
    /// 2. Queries at every particle.
    /// 3. The distances become the level.
    /// 4. Checks of the answers.
    fn advance(&mut self) -> Result<(), StepError> {
        let system = &mut self.system;
        let (positions, level) = (system.particles.positions(), system.particles.scalar(system.level));
        let (surface, answers) = (&mut system.redistancing, &mut system.answers);
        let (interrupt, phases) = (&system.interrupt, &mut self.course.phases);
        let (points, level, normals) = match &mut system.source {
            Source::Grid(remeshing) => {
                phases.measure("remeshing", || remeshing.interpolate(positions, level, interrupt))?;
                (remeshing.nodes(), remeshing.values(), None)
            }
            Source::Others { positions, level } => (positions.as_slice(), level.as_slice(), None),
            Source::Particles => {
                (positions, level, (self.course.step > 0).then(|| system.particles.vector(system.columns.normal)))
            }
        };
        rebuild(surface, points, level, normals, interrupt, phases)?;
        query(surface, positions, f64::INFINITY, answers, interrupt, phases)?;
        if surface.is_lost() {
            let Clock { step, time } = self.course.next();
            return Err(StepError::InterfaceLost { step, time });
        }
        // Particles beyond the band serve the fits and are redistanced like the others; the band's flags stay.
        if let Source::Others { .. } = system.source {
            // Points of no level of their own learn their side from the surface.
            for (i, answer) in system.answers.iter() {
                let x = system.particles.positions()[i];
                let is_inside = system.redistancing.is_inside(&x, answer);
                system.particles.scalar_mut(system.level)[i] = if is_inside { -1.0 } else { 1.0 };
                system.particles.flag_mut(system.columns.in_band)[i] = 1;
            }
        }
        self.course.phases.measure("redistancing/store", || {
            let has_own_level = matches!(system.source, Source::Particles);
            for (i, answer) in system.answers.iter() {
                system.columns.write(&mut system.particles, system.level, i, answer);
                if has_own_level && system.particles.scalar(system.level)[i] == 0.0 {
                    // The surface passes through the particle, also of the next redistancing.
                    system.particles.scalar_mut(system.columns.phi)[i] = 0.0;
                    let x = system.particles.positions()[i];
                    system.particles.vector_mut(system.columns.closest_point)[i] = x;
                }
                let phi = system.particles.scalar(system.columns.phi)[i];
                system.particles.scalar_mut(system.level)[i] = phi;
            }
        });
        first_broken(system.columns.find_broken(&system.particles), self.course.next())?;
        self.check()?;
        self.course.step += 1;
        Ok(())
    }

    fn is_measurement_due(&self) -> bool {
        let step = self.course.step;
        let is_measured = self.measured.as_ref().is_some_and(|(measured, _)| *measured == step);
        self.system.surface.is_some() && !is_measured && self.plan.is_series_due(&self.course.fixed(), step)
    }

    fn measure(&mut self) -> Result<(), StepError> {
        let (system, clock) = (&self.system, self.course.clock());
        let found = errors(system, clock, &system.interrupt)?;
        self.measured = Some((clock.step, found));
        Ok(())
    }

    fn observables(&self) -> Observables {
        let counts = &self.system.redistancing.fit_diagnostics().counts;
        let errors = self.errors();
        let of_phi =
            |norm: &str| errors.iter().find(|e| e.quantity == "phi" && e.norm == norm).map_or(f64::NAN, |e| e.value);
        vec![
            (&TIME, self.clock().time),
            (&PHI_ERROR_RMS, of_phi("rms")),
            (&PHI_ERROR_MAX, of_phi("max")),
            (&RESCUED_FITS, rescued(counts) as f64),
        ]
    }

    fn fields<'a>(&self, selection: Selection<'a>) -> Fields<'a> {
        let particles = &self.system.particles;
        let mut fields = Fields::new(particles.positions(), selection);
        fields.surface(particles, &self.system.columns, self.course.step > 0);
        fields.particle_id();
        fields
    }

    fn save(&self, state: &mut Section) {
        self.course.save(state);
        state.put_section("particles", |section| save_particles(&self.system.particles, section));
        state.put_component("redistancing", self.system.redistancing.fit_diagnostics());
        if self.watched != Watched::default() {
            state.put_component("watched", &self.watched);
        }
        if let Source::Grid(remeshing) = &self.system.source {
            state.put_reals("remeshed_level", remeshing.values());
        }
    }

    fn load(&mut self, state: &Section) -> Result<(), LoadError> {
        let clock = self.course.check(state)?;
        let soundness: FitDiagnostics = state.component("redistancing")?;
        let remeshed = match &self.system.source {
            Source::Grid(remeshing) => Some(state.reals_of("remeshed_level", remeshing.values().len())?),
            _ => None,
        };
        // There are none before the first redistancing, nor in checkpoints of 0.2.0.
        let watched = if state.has("watched") { state.component("watched")? } else { Watched::default() };
        state.section("particles", |section| load_particles(&mut self.system.particles, section))?;
        // From here on nothing fails.
        if let (Source::Grid(remeshing), Some(values)) = (&mut self.system.source, remeshed) {
            remeshing.restore(values);
        }
        *self.system.redistancing.fit_diagnostics_mut() = soundness;
        (self.watched, self.measured) = (watched, None);
        self.course.step = clock.step;
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        let has_grid = matches!(self.system.source, Source::Grid(_));
        format_1::translate(arrays, &self.system.particles, has_grid)
    }

    fn report(&self) -> Report {
        Report {
            errors: self.errors(),
            health: self.health(),
            diagnostics: closest_point_diagnostics(self.system.redistancing.fit_diagnostics()),
            method: self.course.method.clone(),
        }
    }

    fn health(&self) -> Health {
        let finite = self.system.particles.scalar(self.system.columns.phi).iter().all(|v| v.is_finite());
        Health { finite, max_cfl: 0.0, volume_drift: None, checks: self.watched.checks() }
    }

    fn particle_count(&self) -> usize {
        self.system.particles.len()
    }
}
