//! A front step by step.

use super::config::FrontConfig;
use super::exact::{FrontErrors, front_errors};
use super::exact_front::{ExactFrontMotion, Moment};
use super::foot_points::FootPoints;
use super::grid::Grid;
use super::removals::Removals;
use super::system::FrontSystem;
use crate::geometry::Vector;
use crate::geometry::surfaces::Ball;
use crate::schemes::measured_errors::entry;
use crate::simulation::report::Newton;
use crate::simulation::state::check_length;
use crate::simulation::{
    CpuClock, Fields, Finding, Health, Observables, Phases, Report, RestoreError, Simulation, State, StepError,
};
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

/// A front as a simulation, M = D − 1.
pub struct GridBasedParticles<const D: usize, const M: usize> {
    system: FrontSystem<D, M>,
    exact: Box<dyn ExactFrontMotion<D>>,
    /// The front at the start, where it is a ball.
    ball: Option<Ball<D>>,
    /// Length or area of the front at the start, up to a constant factor.
    start_area: f64,
    fixed: FixedStep,
    step: u64,
    max_cfl: f64,
    /// When the last particle went.
    vanished: Option<f64>,
    errors: Vec<FrontErrors>,
    findings: Vec<Finding>,
    phases: Phases,
    method: BTreeMap<&'static str, String>,
}

impl<const D: usize, const M: usize> GridBasedParticles<D, M> {
    /// At time 0.
    #[must_use]
    pub fn new(
        system: FrontSystem<D, M>,
        exact: Box<dyn ExactFrontMotion<D>>,
        ball: Option<Ball<D>>,
        fixed: FixedStep,
        cpu_clock: CpuClock,
        method: BTreeMap<&'static str, String>,
    ) -> Self {
        Self {
            start_area: system.area_or_length(),
            system,
            exact,
            ball,
            fixed,
            step: 0,
            max_cfl: 0.0,
            vanished: None,
            errors: Vec::new(),
            findings: Vec::new(),
            phases: Phases::new(cpu_clock),
            method,
        }
    }

    /// Whether errors are due after a step: at the end, and where a flow turns.
    fn is_error_due(&self, step: u64) -> bool {
        let turn = self.system.config.law.return_time();
        step == self.fixed.steps || turn.is_some_and(|turn| self.fixed.reaches(step, 0.5 * turn))
    }

    /// Fails where the front has grown more than its law allows.
    fn check_growth(&self, Clock { step, time }: Clock) -> Result<(), StepError> {
        let Some(most) = self.system.config.law.most_growth() else { return Ok(()) };
        let growth = self.system.area_or_length() / self.start_area;
        if growth <= most {
            return Ok(());
        }
        let reason = format!(
            "the front is {growth:.1} times as large as at the start, though by its mean curvature it only shrinks: the time \
             step ({}) is too long, the particles of a reconstruction are too few, or the spacing is too coarse",
            self.fixed.time_step
        );
        Err(StepError::Unsolved { reason, step, time })
    }

    /// Reports open ends of a front that must stay closed.
    fn look_for_ends(&mut self, time: f64) {
        if !self.system.config.law.keeps_fronts_closed() {
            return;
        }
        let ends = self.system.open_ends();
        if let Some(first) = ends.first() {
            let place: Vec<String> = self.system.feet.positions[*first].iter().map(|c| format!("{c:.4}")).collect();
            let message = format!(
                "{} of {} foot-points are at open ends, the first at ({}): the front is finer there than its spacing",
                ends.len(),
                self.system.particle_count(),
                place.join(", ")
            );
            self.findings.push(Finding { name: "front_open", message, time });
        }
    }

    fn velocity(&self, i: usize) -> Vector<D> {
        self.system.config.law.velocity(&self.system.feet, i, self.clock().time)
    }
}

impl<const D: usize, const M: usize> Simulation for GridBasedParticles<D, M> {
    fn clock(&self) -> Clock {
        self.fixed.clock(self.step)
    }

    fn end(&self) -> Clock {
        self.fixed.clock(self.fixed.steps)
    }

    /// 1. Motion, topology and resampling, as long as there is a front. 2. Errors, where they are due.
    fn step(&mut self) -> Result<(), StepError> {
        let (from, to) = (self.clock(), self.fixed.clock(self.step + 1));
        if !self.system.feet.is_empty() {
            let way = self.system.advance(from, to, self.fixed.time_step, &mut self.phases)?;
            self.max_cfl = self.max_cfl.max(way);
            self.check_growth(to)?;
            if self.system.feet.is_empty() {
                self.vanished = Some(to.time);
                let counts = self.system.removals.entries().map(|(name, count)| format!("{name} {count}")).join(", ");
                let message = format!("no foot-point is left at time {}; so far: {counts}", to.time);
                self.findings.push(Finding { name: "front_vanished", message, time: to.time });
            }
        }
        if self.is_error_due(to.step) {
            let Self { exact, ball, system, phases, .. } = self;
            let FrontConfig { grid, interrupt, .. } = &system.config;
            let moment = Moment { feet: &system.feet, grid, time: to.time, interrupt };
            let found = phases.measure("errors", || front_errors(exact.as_ref(), ball.as_ref(), &moment))?;
            self.errors.extend(found);
            self.look_for_ends(to.time);
        }
        self.step = to.step;
        Ok(())
    }

    fn observables(&self) -> Observables {
        let feet = &self.system.feet;
        let removals = &self.system.removals;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let radius = self.ball.as_ref().map_or(f64::NAN, |ball| {
            let radii: Vec<f64> = feet.positions.iter().map(|x| (x - ball.center).norm()).collect();
            mean(&radii)
        });
        vec![
            ("time", self.clock().time),
            ("time_step", self.fixed.time_step),
            ("foot_points", feet.len() as f64),
            ("curvature_mean", mean(&feet.curvatures)),
            ("radius_mean", radius),
            ("cfl", self.max_cfl),
            ("unresolved", (removals.starved + removals.extrapolated + removals.unresolved) as f64),
            ("swept", removals.swept as f64),
            ("kept", removals.kept as f64),
        ]
    }

    fn fields(&self) -> Fields {
        let feet = &self.system.feet;
        let grid = self.system.config.grid;
        let mut fields = Fields::at(&feet.positions);
        // Of a wave front the direction of travel.
        let is_curve_in_space = D - M == 2;
        let travel = |i: usize| self.velocity(i).try_normalize(0.0).unwrap_or(feet.normals[i]);
        let normal = |i: usize| if is_curve_in_space { travel(i) } else { feet.normals[i] };
        fields.vector("normal", (0..feet.len()).map(normal));
        fields.scalar("curvature", feet.curvatures.clone());
        if D == 3 && !is_curve_in_space {
            // Shapes tell their mean curvature alone.
            let known = |value: &f64| if self.step > 0 { *value } else { f64::NAN };
            fields.scalar("gauss_curvature", feet.gauss_curvatures.iter().map(known).collect());
        }
        fields.vector("velocity", (0..feet.len()).map(|i| self.velocity(i)));
        fields.vector("grid_point", feet.nodes.iter().map(|node| grid.place::<D>(*node)));
        fields.scalar("level", feet.nodes.iter().map(|node| f64::from(Grid::level(*node))).collect());
        if self.system.config.segments.parameter.is_some() {
            fields.scalar("parameter", feet.parameters.clone());
        }
        fields.scalar("segment", feet.parts.iter().map(|part| f64::from(*part)).collect());
        fields.id("particle_id", (0..feet.len() as u64).collect());
        fields
    }

    fn state(&self) -> State {
        let Clock { step, time } = self.clock();
        let mut state = State { step, time, ..State::default() };
        self.system.feet.save(&mut state);
        state.push_counts("removals", self.system.removals.entries().map(|(_, count)| count).to_vec());
        state.push_counts("has_vanished", vec![u64::from(self.vanished.is_some())]);
        state.push_reals("monitors", &[self.max_cfl, self.vanished.unwrap_or(0.0)]);
        let errors: Vec<f64> = self.errors.iter().flat_map(|e| e.to_numbers()).collect();
        state.push_reals("errors", &errors);
        state
    }

    fn restore(&mut self, state: &State) -> Result<(), RestoreError> {
        if state.step > self.fixed.steps {
            return Err(RestoreError::Beyond { step: state.step, last: self.fixed.steps });
        }
        let feet = FootPoints::load(state)?;
        let (removals, monitors) = (state.counts("removals")?, state.reals("monitors")?);
        let (errors, has_vanished) = (state.reals("errors")?, state.counts("has_vanished")?);
        let removals: [u64; 6] = removals.try_into().map_err(|_| RestoreError::Length {
            name: "removals".into(),
            got: removals.len(),
            expected: 6,
        })?;
        check_length("monitors", monitors.len(), 2)?;
        check_length("has_vanished", has_vanished.len(), 1)?;
        check_length("errors", errors.len(), errors.len() / FrontErrors::NUMBERS * FrontErrors::NUMBERS)?;
        self.system.feet = feet;
        self.system.removals = Removals::from_numbers(removals);
        self.max_cfl = monitors[0];
        self.vanished = (has_vanished[0] > 0).then_some(monitors[1]);
        self.errors = errors.chunks_exact(FrontErrors::NUMBERS).map(FrontErrors::from_numbers).collect();
        self.step = state.step;
        Ok(())
    }

    fn report(&self) -> Report {
        let mut errors: Vec<_> = self.errors.iter().flat_map(FrontErrors::entries).collect();
        if let Some(time) = self.vanished {
            errors.push(entry("extinction", "time", time, time, "the last particle removed"));
            if let Some(exact) = self.exact.extinction(self.ball.as_ref()) {
                errors.push(entry("extinction", "absolute", (time - exact).abs(), time, "exact motion"));
            }
        }
        Report {
            errors,
            health: self.health(),
            worst_condition: 1.0,
            rescued_fits: self.system.removals.entries().into_iter().filter(|(_, count)| *count > 0).collect(),
            newton: Newton::default(),
            method: self.method.clone(),
        }
    }

    fn phases(&self) -> &Phases {
        &self.phases
    }

    fn health(&self) -> Health {
        let removals = &self.system.removals;
        Health {
            finite: self.system.feet.positions.iter().all(|x| x.iter().all(|c| c.is_finite())),
            max_cfl: self.max_cfl,
            volume_drift: None,
            rescued_fits: removals.kept,
        }
    }

    fn particle_count(&self) -> usize {
        self.system.feet.len()
    }

    fn take_findings(&mut self) -> Vec<Finding> {
        std::mem::take(&mut self.findings)
    }
}

#[cfg(test)]
mod tests;
