//! One step a redistancing: the distances of one are the input of the next.

use super::checks::Watched;
use super::format_1;
use super::quantities::{PHI_ERROR_MAX, PHI_ERROR_RMS, RESCUED_FITS, TIME};
use super::system::{Source, StaticSystem};
use crate::closest_point::{Coverage, FitDiagnostics};
use crate::schemes::measured_errors::{ErrorNorms, closest_point_diagnostics, rescued};
use crate::schemes::measured_redistancing::{query, rebuild};
use crate::simulation::components::{load_particles, save_particles};
use crate::simulation::course::first_broken;
use crate::simulation::{
    Course, CpuClock, ErrorEntry, Fields, Health, LoadError, Observables, Phases, Report, Section, Selection,
    Simulation, StepError,
};
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

/// A static redistancing as a simulation; scene time counts redistancings.
pub struct StaticRedistancing<const D: usize> {
    system: StaticSystem<D>,
    course: Course,
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
        Self { system, course, watched: Watched::default(), distances: Vec::new() }
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

    /// Errors against the exact surface over the band; none where it is not known.
    fn errors(&self) -> Vec<ErrorEntry> {
        let system = &self.system;
        let particles = &system.particles;
        let mut entries = Vec::new();
        let Some(surface) = &system.surface else { return entries };
        let mut norms = [ErrorNorms::default(); 4];
        for i in 0..particles.len() {
            if particles.flag(system.columns.in_band)[i] == 0 {
                continue;
            }
            let x = particles.positions()[i];
            let exact = surface.nearest(&x);
            norms[0].add(particles.scalar(system.columns.phi)[i] - exact.distance);
            // Where two points of the surface are nearly as close, another choice is no error.
            if self.course.step == 0 || surface.near_medial_axis(&x, system.spacing) {
                continue;
            }
            norms[1].add((particles.vector(system.columns.closest_point)[i] - exact.point).norm());
            if let Some(normal) = exact.normal {
                norms[2].add((particles.vector(system.columns.normal)[i] - normal).norm());
            }
            if let Some(curvature) = exact.curvature {
                norms[3].add(particles.scalar(system.columns.curvature)[i] - curvature);
            }
        }
        if let Source::Grid(remeshing) = &system.source
            && self.course.step > 0
        {
            // The first interpolation is of the exact level; later ones are of distances that were computed.
            let mut norms = ErrorNorms::default();
            for (x, value) in remeshing.nodes().iter().zip(remeshing.values()) {
                let distance = surface.signed_distance(x);
                let exact = if self.course.step == 1 { system.initial.value(x, distance) } else { distance };
                if distance.abs() <= system.half_band {
                    norms.add(value - exact);
                }
            }
            entries.extend(norms.entries("remeshed_level", self.clock().time, "exact level at the nodes"));
        }
        let names = ["phi", "closest_point", "normal", "curvature"];
        let time = self.clock().time;
        let found = names.iter().zip(&norms).filter(|(_, norms)| !norms.is_empty());
        entries.extend(found.flat_map(|(name, norms)| norms.entries(name, time, "exact surface")));
        entries
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
    fn step(&mut self) -> Result<(), StepError> {
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
        state.put_component("watched", &self.watched);
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
        // Checkpoints of 0.2.0 have no values of checks.
        let watched = if state.has("watched") { state.component("watched")? } else { Watched::default() };
        state.section("particles", |section| load_particles(&mut self.system.particles, section))?;
        // From here on nothing fails.
        if let (Source::Grid(remeshing), Some(values)) = (&mut self.system.source, remeshed) {
            remeshing.restore(values);
        }
        *self.system.redistancing.fit_diagnostics_mut() = soundness;
        self.watched = watched;
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
