//! One step a redistancing: the distances of one are the input of the next.

use super::system::{Source, StaticSystem};
use crate::schemes::measured_errors::{ErrorNorms, closest_point_report, rescued};
use crate::schemes::measured_redistancing::{query, rebuild};
use crate::simulation::{
    CpuClock, ErrorEntry, Fields, Finding, Health, Observables, Phases, Report, RestoreError, Simulation, State,
    StepError,
};
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

/// A static redistancing as a simulation; scene time counts redistancings.
pub struct StaticRedistancing<const D: usize> {
    system: StaticSystem<D>,
    fixed: FixedStep,
    step: u64,
    phases: Phases,
    method: BTreeMap<&'static str, String>,
}

impl<const D: usize> StaticRedistancing<D> {
    /// At the start.
    #[must_use]
    pub fn new(system: StaticSystem<D>, cpu_clock: CpuClock, method: BTreeMap<&'static str, String>) -> Self {
        let fixed = FixedStep { time_step: 1.0, steps: system.repeats };
        Self { system, fixed, step: 0, phases: Phases::new(cpu_clock), method }
    }

    /// The numbers of a step must be numbers.
    fn check_finite(&self) -> Result<(), StepError> {
        let Clock { step, time } = self.fixed.clock(self.step + 1);
        match self.system.columns.find_broken(&self.system.particles) {
            Some((field, particle)) => Err(StepError::NonFinite { field, particle, step, time }),
            None => Ok(()),
        }
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
            if self.step == 0 || surface.near_medial_axis(&x, system.spacing) {
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
            && self.step > 0
        {
            // The first interpolation is of the exact level; later ones are of distances that were computed.
            let mut norms = ErrorNorms::default();
            for (x, value) in remeshing.nodes().iter().zip(remeshing.values()) {
                let distance = surface.signed_distance(x);
                let exact = if self.step == 1 { system.initial.value(x, distance) } else { distance };
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
    fn clock(&self) -> Clock {
        self.fixed.clock(self.step)
    }

    fn end(&self) -> Clock {
        self.fixed.clock(self.fixed.steps)
    }

    /// 1. Detection, regression and projection from the present level, or from what a grid gets of it.
    /// 2. Queries at every particle.
    /// 3. The distances become the level.
    fn step(&mut self) -> Result<(), StepError> {
        let system = &mut self.system;
        let (positions, level) = (system.particles.positions(), system.particles.scalar(system.level));
        let (surface, answers) = (&mut system.redistancing, &mut system.answers);
        let (interrupt, phases) = (&system.interrupt, &mut self.phases);
        let (points, level, normals) = match &mut system.source {
            Source::Grid(remeshing) => {
                phases.measure("remeshing", || remeshing.interpolate(positions, level, interrupt))?;
                (remeshing.nodes(), remeshing.values(), None)
            }
            Source::Others { positions, level } => (positions.as_slice(), level.as_slice(), None),
            Source::Particles => {
                (positions, level, (self.step > 0).then(|| system.particles.vector(system.columns.normal)))
            }
        };
        rebuild(surface, points, level, normals, interrupt, phases)?;
        query(surface, positions, f64::INFINITY, answers, interrupt, phases)?;
        if surface.is_lost() {
            let Clock { step, time } = self.fixed.clock(self.step + 1);
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
        self.phases.measure("redistancing/store", || {
            for (i, answer) in system.answers.iter() {
                system.columns.write(&mut system.particles, system.level, i, answer);
                let phi = system.particles.scalar(system.columns.phi)[i];
                system.particles.scalar_mut(system.level)[i] = phi;
            }
        });
        self.check_finite()?;
        self.step += 1;
        Ok(())
    }

    fn observables(&self) -> Observables {
        let counts = &self.system.redistancing.fit_diagnostics().counts;
        let errors = self.errors();
        let of_phi =
            |norm: &str| errors.iter().find(|e| e.quantity == "phi" && e.norm == norm).map_or(f64::NAN, |e| e.value);
        vec![
            ("time", self.clock().time),
            ("phi_error_rms", of_phi("rms")),
            ("phi_error_max", of_phi("max")),
            ("rescued_fits", rescued(counts) as f64),
        ]
    }

    fn fields(&self) -> Fields {
        let particles = &self.system.particles;
        let mut fields = Fields::at(particles.positions());
        fields.surface(particles, &self.system.columns, self.step > 0);
        fields.id("particle_id", (0..particles.len() as u64).collect());
        fields
    }

    fn state(&self) -> State {
        let Clock { step, time } = self.clock();
        let mut state = State { step, time, ..State::default() };
        state.push_particles(&self.system.particles);
        let fit_diagnostics = self.system.redistancing.fit_diagnostics();
        state.push_counts("rescues", fit_diagnostics.counts.entries().iter().map(|e| e.1).collect());
        state.push_reals("worst_condition", &[fit_diagnostics.worst_condition]);
        if let Source::Grid(remeshing) = &self.system.source {
            state.push_reals("remeshed_level", remeshing.values());
        }
        state
    }

    fn restore(&mut self, state: &State) -> Result<(), RestoreError> {
        if state.step > self.fixed.steps {
            return Err(RestoreError::Beyond { step: state.step, last: self.fixed.steps });
        }
        let fit_diagnostics = self.system.redistancing.fit_diagnostics_mut();
        let (rescues, condition) = (state.counts("rescues")?, state.reals("worst_condition")?);
        crate::simulation::state::check_length("rescues", rescues.len(), fit_diagnostics.counts.entries().len())?;
        crate::simulation::state::check_length("worst_condition", condition.len(), 1)?;
        if let Source::Grid(remeshing) = &mut self.system.source {
            let values = state.reals("remeshed_level")?;
            crate::simulation::state::check_length("remeshed_level", values.len(), remeshing.values().len())?;
            remeshing.restore(values);
        }
        state.pull_particles(&mut self.system.particles)?;
        fit_diagnostics.counts.restore(rescues);
        fit_diagnostics.worst_condition = condition[0];
        self.step = state.step;
        Ok(())
    }

    fn report(&self) -> Report {
        let errors = self.errors();
        closest_point_report(self.system.redistancing.fit_diagnostics(), errors, self.health(), self.method.clone())
    }

    fn phases(&self) -> &Phases {
        &self.phases
    }

    fn health(&self) -> Health {
        let finite = self.system.particles.scalar(self.system.columns.phi).iter().all(|v| v.is_finite());
        let rescued_fits = rescued(&self.system.redistancing.fit_diagnostics().counts);
        Health { finite, max_cfl: 0.0, volume_drift: None, rescued_fits }
    }

    fn particle_count(&self) -> usize {
        self.system.particles.len()
    }

    fn take_findings(&mut self) -> Vec<Finding> {
        Vec::new()
    }
}
