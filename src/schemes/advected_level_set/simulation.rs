//! Transport and redistancing step by step.

use super::system::{AdvectedSystem, FieldChoice, RedistanceWhen};
use crate::closest_point::LevelSurface;
use crate::closest_point::enclosed_moments::enclosed_area_or_volume;
use crate::geometry::Vector;
use crate::parallel::{Interrupt, Interrupted};
use crate::particles::Particles;
use crate::schemes::measured_errors::{ErrorNorms, closest_point_report, entry, rescued};
use crate::simulation::state::check_length;
use crate::simulation::{
    CpuClock, ErrorEntry, Fields, Finding, Health, Observables, OutputPlan, Phases, Report, RestoreError, Simulation,
    State, StepError,
};
use crate::time::{Clock, FixedStep};
use rayon::prelude::{IntoParallelIterator, ParallelIterator};
use std::collections::BTreeMap;

/// An advected level set as a simulation.
pub struct AdvectedLevelSet<const D: usize> {
    system: AdvectedSystem<D>,
    fixed: FixedStep,
    plan: OutputPlan,
    step: u64,
    /// Step of the last redistancing; the start counts as one, since its distances are exact.
    redistanced: u64,
    /// Enclosed measure at the last redistancing that was asked for it, and the step of that.
    measure: f64,
    measured: u64,
    /// Enclosed measure at time 0.
    initial_measure: f64,
    max_cfl: f64,
    errors: Vec<MeasuredErrors>,
    phases: Phases,
    method: BTreeMap<&'static str, String>,
}

/// Errors of one moment, as they stand in a state.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MeasuredErrors {
    time: f64,
    measure_relative: f64,
    /// RMS and maximum of φ, mean and maximum of the samples, where the exact front is known.
    distances: Option<[f64; 4]>,
}

impl MeasuredErrors {
    const NUMBERS: usize = 7;

    fn to_numbers(self) -> [f64; Self::NUMBERS] {
        let [rms, max, mean, most] = self.distances.unwrap_or_default();
        let is_known = if self.distances.is_some() { 1.0 } else { 0.0 };
        [self.time, self.measure_relative, is_known, rms, max, mean, most]
    }

    fn from_numbers(n: &[f64]) -> Self {
        let distances = (n[2] > 0.5).then(|| [n[3], n[4], n[5], n[6]]);
        Self { time: n[0], measure_relative: n[1], distances }
    }

    fn entries(&self, dimension: usize) -> Vec<ErrorEntry> {
        let reference = "exact motion";
        let measure = if dimension == 2 { "area" } else { "volume" };
        let mut entries = vec![entry(measure, "relative", self.measure_relative, self.time, "conservation")];
        if let Some([rms, max, mean, most]) = self.distances {
            for (quantity, norm, value) in
                [("phi", "rms", rms), ("phi", "max", max), ("samples", "mean", mean), ("samples", "max", most)]
            {
                entries.push(entry(quantity, norm, value, self.time, reference));
            }
        }
        entries
    }
}

impl<const D: usize> AdvectedLevelSet<D> {
    /// At time 0.
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
                // Whoever interrupts ends the run before its first step.
                copy.and_then(|(_, surface)| enclosed_area_or_volume(&surface, &system.interrupt)).unwrap_or(f64::NAN)
            },
            crate::geometry::Surface::area_or_volume,
        );
        let phases = Phases::new(cpu_clock);
        // What points from elsewhere bring is a level, and no distance yet.
        let redistanced = if system.motion.surface().is_some() { 0 } else { u64::MAX };
        Self {
            system,
            fixed,
            plan,
            step: 0,
            redistanced,
            initial_measure: measure,
            measure,
            measured: 0,
            max_cfl: 0.0,
            errors: Vec::new(),
            phases,
            method,
        }
    }

    /// Whether the step that ends at `step` redistances the particles themselves. On a schedule only the schedule does,
    /// since a redistancing leaves its distances or normals to the next: what output asks for in between is taken on a
    /// copy and never becomes physics. Without a schedule nothing is left to anybody, so output may redistance.
    fn is_redistancing_due(&self, step: u64) -> bool {
        match self.system.parts.when {
            RedistanceWhen::ForOutput => {
                step >= self.fixed.steps || self.is_error_due(step) || self.plan.is_frame_due(&self.fixed, step)
            }
            RedistanceWhen::Every(every) => step.is_multiple_of(every),
        }
    }

    /// Errors are taken half way through a flow that returns, and at the end.
    fn is_error_due(&self, step: u64) -> bool {
        let halfway = self.system.motion.flow().return_time().is_some_and(|t| self.fixed.reaches(step, 0.5 * t));
        step >= self.fixed.steps || halfway
    }

    fn check_finite(&self, clock: Clock) -> Result<(), StepError> {
        let Clock { step, time } = clock;
        let broken = self.system.particles.positions().iter().position(|x| x.iter().any(|c| !c.is_finite()));
        if let Some(particle) = broken {
            return Err(StepError::NonFinite { field: "position", particle, step, time });
        }
        Ok(())
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
        let distance = |x: &Vector<D>| if interrupt.is_raised() { 0.0 } else { front.signed_distance(x) };
        let band = particles.flag(system.columns.in_band);
        let phi = particles.scalar(system.columns.phi);
        let differences: Vec<f64> = (0..particles.len())
            .into_par_iter()
            .filter(|&i| band[i] == 1)
            .map(|i| phi[i] - distance(&particles.positions()[i]))
            .collect();
        let mut norms = ErrorNorms::default();
        for difference in differences {
            norms.add(difference);
        }
        let (samples_mean, samples_max) = surface.mean_and_max(|x| distance(x).abs());
        interrupt.check()?;
        // Over an empty band there is no error, which is not an error of zero.
        let distances = (!norms.is_empty()).then(|| [norms.rms(), norms.max(), samples_mean, samples_max]);
        Ok(MeasuredErrors { time, measure_relative, distances })
    }

    /// Takes the errors of this moment: of the particles as they are where they were just redistanced, else of a copy,
    /// so that asking for an error never becomes part of the physics.
    fn take_errors(&mut self, now: Clock) -> Result<(), StepError> {
        let start = (self.phases.clock())();
        let measured = if self.redistanced == now.step {
            self.measure_errors(now.time, &self.system.particles, &self.system.redistancing, self.measure)?
        } else {
            let (particles, surface) = self.system.redistanced_copy(&self.system.interrupt)?;
            if surface.is_lost() {
                return Err(StepError::InterfaceLost { step: now.step, time: now.time });
            }
            // What the copy could not do the plain way stands behind the errors that are reported.
            self.system.redistancing.fit_diagnostics_mut().merge(surface.fit_diagnostics());
            self.measure = enclosed_area_or_volume(&surface, &self.system.interrupt)?;
            self.measured = now.step;
            self.measure_errors(now.time, &particles, &surface, self.measure)?
        };
        self.errors.push(measured);
        self.phases.book("errors", (self.phases.clock())() - start);
        Ok(())
    }
}

impl<const D: usize> Simulation for AdvectedLevelSet<D> {
    fn clock(&self) -> Clock {
        self.fixed.clock(self.step)
    }

    fn end(&self) -> Clock {
        self.fixed.clock(self.fixed.steps)
    }

    /// 1. Transport: positions move, ψ stays with them.
    /// 2. Redistancing, on the scene's schedule or, without one, where output needs it.
    /// 3. The enclosed measure for a due series row; errors half way and at the end.
    fn step(&mut self) -> Result<(), StepError> {
        let before = self.clock();
        let next = self.fixed.clock(self.step + 1);
        let (system, fixed) = (&mut self.system, &self.fixed);
        let way = self.phases.measure("advection", || system.advect(before.time, fixed.time_step))?;
        self.check_finite(next)?;
        self.max_cfl = self.max_cfl.max(way);
        if self.is_redistancing_due(next.step) {
            self.system.redistance(&mut self.phases)?;
            if self.system.redistancing.is_lost() {
                return Err(StepError::InterfaceLost { step: next.step, time: next.time });
            }
            let columns = &self.system.columns;
            if let Some((field, particle)) = columns.find_broken(&self.system.particles) {
                return Err(StepError::NonFinite { field, particle, step: next.step, time: next.time });
            }
            self.redistanced = next.step;
            if self.is_error_due(next.step) || self.plan.is_series_due(&self.fixed, next.step) {
                let system = &self.system;
                self.measure = self
                    .phases
                    .measure("measure", || enclosed_area_or_volume(&system.redistancing, &system.interrupt))?;
                self.measured = next.step;
            }
        }
        if self.is_error_due(next.step) {
            self.take_errors(next)?;
        }
        self.step = next.step;
        Ok(())
    }

    fn observables(&self) -> Observables {
        let exact = self.initial_measure;
        let band = self.system.particles.flag(self.system.columns.in_band);
        // Between redistancings nobody knows the surface, and a stale number would look like knowledge.
        let known = |fresh: bool, value: f64| if fresh { value } else { f64::NAN };
        let is_measured = self.measured == self.step;
        let in_band = known(self.redistanced == self.step, band.iter().map(|b| f64::from(*b)).sum());
        vec![
            ("time", self.clock().time),
            ("time_step", self.fixed.time_step),
            (if D == 2 { "area" } else { "volume" }, known(is_measured, self.measure)),
            ("volume_drift", known(is_measured, (self.measure - exact) / exact)),
            ("band_particles", in_band),
            ("cfl", self.max_cfl),
            ("rescued_fits", rescued(&self.system.redistancing.fit_diagnostics().counts) as f64),
        ]
    }

    fn fields(&self) -> Fields {
        let fresh;
        let particles = if self.redistanced == self.step {
            &self.system.particles
        } else {
            // Without an interrupt nothing fails; the particles as they are would be shown otherwise.
            match self.system.redistanced_copy(&Interrupt::default()) {
                Ok((copy, _)) => {
                    fresh = copy;
                    &fresh
                }
                Err(Interrupted) => &self.system.particles,
            }
        };
        let mut fields = Fields::at(particles.positions());
        fields.surface(particles, &self.system.columns, true);
        if self.system.parts.field == FieldChoice::Dual {
            fields.scalar("psi", particles.scalar(self.system.psi).to_vec());
        }
        let (flow, time) = (self.system.motion.flow(), self.clock().time);
        fields.vector("velocity", particles.positions().iter().map(|x| flow.velocity(x, time)));
        fields.id("particle_id", (0..particles.len() as u64).collect());
        fields
    }

    fn state(&self) -> State {
        let Clock { step, time } = self.clock();
        let mut state = State { step, time, ..State::default() };
        state.push_particles(&self.system.particles);
        let fit_diagnostics = self.system.redistancing.fit_diagnostics();
        state.push_counts("rescues", fit_diagnostics.counts.entries().iter().map(|e| e.1).collect());
        state.push_counts("redistanced", vec![self.redistanced, self.measured]);
        state.push_reals("monitors", &[self.measure, self.max_cfl, fit_diagnostics.worst_condition]);
        let errors: Vec<f64> = self.errors.iter().flat_map(|e| e.to_numbers()).collect();
        state.push_reals("errors", &errors);
        state
    }

    fn restore(&mut self, state: &State) -> Result<(), RestoreError> {
        if state.step > self.fixed.steps {
            return Err(RestoreError::Beyond { step: state.step, last: self.fixed.steps });
        }
        let fit_diagnostics = self.system.redistancing.fit_diagnostics_mut();
        let (rescues, redistanced) = (state.counts("rescues")?, state.counts("redistanced")?);
        let (monitors, errors) = (state.reals("monitors")?, state.reals("errors")?);
        check_length("rescues", rescues.len(), fit_diagnostics.counts.entries().len())?;
        check_length("redistanced", redistanced.len(), 2)?;
        check_length("monitors", monitors.len(), 3)?;
        check_length("errors", errors.len(), errors.len() / MeasuredErrors::NUMBERS * MeasuredErrors::NUMBERS)?;
        state.pull_particles(&mut self.system.particles)?;
        fit_diagnostics.counts.restore(rescues);
        fit_diagnostics.worst_condition = monitors[2];
        self.measure = monitors[0];
        self.max_cfl = monitors[1];
        self.redistanced = redistanced[0];
        self.measured = redistanced[1];
        self.errors = errors.chunks_exact(MeasuredErrors::NUMBERS).map(MeasuredErrors::from_numbers).collect();
        self.step = state.step;
        Ok(())
    }

    fn report(&self) -> Report {
        let errors = self.errors.iter().flat_map(|e| e.entries(D)).collect();
        closest_point_report(self.system.redistancing.fit_diagnostics(), errors, self.health(), self.method.clone())
    }

    fn phases(&self) -> &Phases {
        &self.phases
    }

    fn health(&self) -> Health {
        let exact = self.initial_measure;
        Health {
            finite: self.system.particles.positions().iter().all(|x| x.iter().all(|c| c.is_finite())),
            max_cfl: self.max_cfl,
            volume_drift: Some((self.measure - exact) / exact),
            rescued_fits: rescued(&self.system.redistancing.fit_diagnostics().counts),
        }
    }

    fn particle_count(&self) -> usize {
        self.system.particles.len()
    }

    fn take_findings(&mut self) -> Vec<Finding> {
        Vec::new()
    }
}
