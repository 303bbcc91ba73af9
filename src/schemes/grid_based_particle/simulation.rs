//! The simulation of a front.

use super::config::FrontConfig;
use super::errors::{FrontErrors, front_errors};
use super::exact_front::{ExactFrontMotion, Moment};
use super::foot_points::FootPoints;
use super::format_1;
use super::frame_fields;
use super::front_watch::FrontWatch;
use super::quantities;
use super::removals::Removals;
use super::system::FrontSystem;
use crate::geometry::shown;
use crate::geometry::surfaces::Ball;
use crate::schemes::flow_divergence::divergence_diagnostic;
use crate::schemes::measured_errors::entry;
use crate::simulation::course::is_finite;
use crate::simulation::{
    Course, CpuClock, Fields, Finding, Health, LoadError, Mark, Observables, Phases, Report, Section, Selection,
    Simulation, StepError,
};
use crate::time::{Clock, FixedStep};
use std::collections::BTreeMap;

/// The simulation of a front in D dimensions; M dimensions lie along it, M = D − 1 of a surface.
pub struct GridBasedParticles<const D: usize, const M: usize> {
    system: FrontSystem<D, M>,
    exact: Box<dyn ExactFrontMotion<D>>,
    /// The front at the start, where it is a ball.
    ball: Option<Ball<D>>,
    /// Length or area of the front at the start, up to a constant factor.
    start_area: f64,
    /// Longest displacement in a step so far, in spacings of the finest level.
    max_cfl: f64,
    /// Time at which the last particle was removed.
    vanished: Option<f64>,
    /// Errors at the times where they were due so far.
    errors: Vec<FrontErrors>,
    watch: FrontWatch,
    /// Time of the last measurement.
    measured_at: Option<f64>,
    /// Particles at open ends, where they were looked for in the last step.
    ends: Vec<usize>,
    course: Course,
}

impl<const D: usize, const M: usize> GridBasedParticles<D, M> {
    /// The simulation at time 0. `ball` is the front at the start, where it is a ball.
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
            max_cfl: 0.0,
            vanished: None,
            errors: Vec::new(),
            watch: FrontWatch::new(None, f64::INFINITY),
            measured_at: None,
            ends: Vec::new(),
            course: Course::new(fixed.into(), Phases::new(cpu_clock), method),
        }
    }

    /// Whether errors are due after a step: at the end, and where a flow turns.
    fn is_error_due(&self, step: u64) -> bool {
        let turn = self.system.config.law.return_time();
        step == self.course.pace.last || turn.is_some_and(|turn| self.course.fixed().reaches(step, 0.5 * turn))
    }

    /// The same, of a motion that makes the front at most so many times as large.
    #[must_use]
    pub fn with_stretch(mut self, most: f64) -> Self {
        self.watch = FrontWatch::new(self.system.config.law.most_growth(), most);
        self
    }

    /// Growth of the front since the start.
    fn growth(&self) -> f64 {
        self.system.area_or_length() / self.start_area
    }

    /// Fails where the front has grown more than its law allows.
    fn check_growth(&self, now: Clock) -> Result<(), StepError> {
        let growth = self.growth();
        let Some(most) = self.system.config.law.most_growth() else { return self.watch.look_at_growth(growth, now) };
        if growth <= most {
            return Ok(());
        }
        let reason = format!(
            "the front is {growth:.1} times as large as at the start, though by its mean curvature it only shrinks: the time \
             step ({}) is too long, the particles of a reconstruction are too few, or the spacing is too coarse",
            self.course.pace.time_step
        );
        Err(StepError::Unsolved { reason, step: now.step, time: now.time })
    }

    /// Counts the open ends of a front that must stay closed.
    fn count_open_ends(&mut self, now: Clock) -> Result<(), StepError> {
        if self.system.feet.is_empty() {
            // What has vanished has no ends.
            self.watch.forget_ends();
        } else if self.system.config.law.keeps_fronts_closed() {
            self.ends = self.system.open_ends();
            self.watch.look_at_ends(self.ends.len(), self.system.feet.len(), now)?;
        }
        Ok(())
    }

    /// Reports open ends of a front that must stay closed.
    fn tell_open_ends(&mut self, Clock { step, time }: Clock) {
        let ends = &self.ends;
        if let Some(first) = ends.first() {
            let message = format!(
                "{} of {} foot-points are at open ends, the first at {}: the front is finer there than its spacing",
                ends.len(),
                self.system.particle_count(),
                shown(&self.system.feet.positions[*first])
            );
            let finding = Finding::warning("front_open", message, (step, time)).about(ends);
            self.course.findings.push(finding.with_advice("a smaller spacing resolves the front"));
        }
    }
}

impl<const D: usize, const M: usize> Simulation for GridBasedParticles<D, M> {
    fn course(&self) -> &Course {
        &self.course
    }

    fn course_mut(&mut self) -> &mut Course {
        &mut self.course
    }

    /// Moves and resamples the front, as long as there is one.
    fn advance(&mut self) -> Result<(), StepError> {
        let (from, to) = (self.clock(), self.course.next());
        self.ends.clear();
        if !self.system.feet.is_empty() {
            let displacement = self.system.advance(from, to, self.course.pace.time_step, &mut self.course.phases)?;
            self.max_cfl = self.max_cfl.max(displacement);
            self.check_growth(to)?;
            if FrontWatch::is_look_due(to.step) {
                self.count_open_ends(to)?;
            }
            if self.system.feet.is_empty() {
                self.vanished = Some(to.time);
                let counts = self.system.removals.entries().map(|(name, count)| format!("{name} {count}")).join(", ");
                let message = format!("no foot-point is left at time {}; so far: {counts}", to.time);
                self.course.findings.push(Finding::info("front_vanished", message, (to.step, to.time)));
            }
        }
        self.course.step = to.step;
        Ok(())
    }

    fn is_measurement_due(&self) -> bool {
        let Clock { step, time } = self.clock();
        step > 0 && self.is_error_due(step) && self.measured_at != Some(time)
    }

    fn measure(&mut self) -> Result<(), StepError> {
        let to = self.clock();
        let Self { exact, ball, system, course, .. } = self;
        let FrontConfig { grid, interrupt, .. } = &system.config;
        let moment = Moment { feet: &system.feet, grid, time: to.time, interrupt };
        let found = course.phases.measure("errors", || front_errors(exact.as_ref(), ball.as_ref(), &moment))?;
        self.errors.extend(found);
        self.count_open_ends(to)?;
        self.tell_open_ends(to);
        self.measured_at = Some(to.time);
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
            (&quantities::TIME, self.clock().time),
            (&quantities::TIME_STEP, self.course.pace.time_step),
            (&quantities::FOOT_POINTS, feet.len() as f64),
            (&quantities::CURVATURE_MEAN, mean(&feet.curvatures)),
            (&quantities::RADIUS_MEAN, radius),
            (&quantities::CFL, self.max_cfl),
            (&quantities::UNRESOLVED, (removals.starved + removals.extrapolated + removals.unresolved) as f64),
            (&quantities::SWEPT, removals.swept as f64),
            (&quantities::KEPT, removals.kept as f64),
        ]
    }

    fn fields<'a>(&self, selection: Selection<'a>) -> Fields<'a> {
        let mut fields = frame_fields::frame(&self.system, self.clock(), selection);
        if !self.ends.is_empty() {
            fields.marks.push(Mark { code: "front_open", points: self.ends.clone() });
        }
        fields
    }

    fn save(&self, state: &mut Section) {
        self.course.save(state);
        state.put_component("foot_points", &self.system.feet);
        state.put_component("removals", &self.system.removals);
        state.put_real("max_cfl", self.max_cfl);
        state.put_optional("vanished_at", self.vanished);
        state.put_list("errors", &self.errors);
        // A state without it, like those of format 1, was measured where it stands.
        if self.measured_at != Some(self.clock().time) {
            state.put_optional("measured_at", self.measured_at);
        }
        self.watch.save(state);
    }

    fn load(&mut self, state: &Section) -> Result<(), LoadError> {
        let clock = self.course.check(state)?;
        let feet: FootPoints<D> = state.component("foot_points")?;
        let removals: Removals = state.component("removals")?;
        let (max_cfl, vanished) = (state.real("max_cfl")?, state.optional("vanished_at")?);
        let errors = state.list("errors")?;
        // What was measured where it stands is saved without it.
        let measured_at = if state.has("measured_at") { state.optional("measured_at")? } else { Some(clock.time) };
        let watch = self.watch.restored(state)?;
        // From here on nothing fails.
        (self.system.feet, self.system.removals) = (feet, removals);
        self.watch = watch;
        (self.max_cfl, self.vanished, self.errors) = (max_cfl, vanished, errors);
        self.measured_at = measured_at;
        self.ends.clear();
        self.course.step = clock.step;
        Ok(())
    }

    fn translate_format_1(&self, arrays: &Section) -> Result<Section, LoadError> {
        format_1::translate(arrays)
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
            diagnostics: {
                let (system, time) = (&self.system, self.clock().time);
                let mut diagnostics = system.removals.diagnostics();
                let flow = system.config.law.flow();
                diagnostics.extend(flow.and_then(|flow| divergence_diagnostic(flow, &system.feet.positions, time)));
                diagnostics
            },
            method: self.course.method.clone(),
        }
    }

    fn health(&self) -> Health {
        Health {
            finite: self.system.feet.positions.iter().all(is_finite),
            max_cfl: self.max_cfl,
            volume_drift: None,
            checks: self.watch.checks(self.growth()),
        }
    }

    fn particle_count(&self) -> usize {
        self.system.feet.len()
    }
}

#[cfg(test)]
mod tests;
