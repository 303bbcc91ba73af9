//! How far a run is, how fast it goes, what it costs.

use crate::spec::calibration::TimeForecast;
use crate::spec::health::FindingLog;
use crate::spec::records::{Progress, Usage};
use crate::system::process;
use meniscus::scenes::work_estimate::REST;
use meniscus::simulation::Simulation;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Seconds of stepping after which their speed tells that of the machine.
const TELLING_S: f64 = 1.0;
/// Least time between two records.
const INTERVAL: Duration = Duration::from_millis(400);

/// CPU seconds of a phase that comes at milestones.
struct Milestone {
    spent: f64,
    /// As forecast for the whole run.
    all: f64,
}

/// Measures and reports.
pub struct ProgressMeter {
    baseline: Usage,
    baseline_phases: BTreeMap<String, f64>,
    began: Instant,
    cpu_began: f64,
    own_phases: BTreeMap<&'static str, f64>,
    first_step: Option<u64>,
    stepping_since: Instant,
    /// CPU seconds of phases at milestones when the stepping began.
    milestones_before: f64,
    forecast: Option<TimeForecast>,
    last: Option<Instant>,
}

impl ProgressMeter {
    /// For an attempt that begins now and adds to what earlier ones cost.
    #[must_use]
    pub fn new(baseline: Usage, forecast: Option<TimeForecast>) -> Self {
        let now = Instant::now();
        Self {
            baseline,
            baseline_phases: BTreeMap::new(),
            began: now,
            cpu_began: process::cpu_seconds(),
            own_phases: BTreeMap::new(),
            first_step: None,
            stepping_since: now,
            milestones_before: 0.0,
            forecast,
            last: None,
        }
    }

    /// Adds CPU seconds by phase that earlier attempts spent up to the checkpoint of this one.
    pub fn continue_phases(&mut self, phases: BTreeMap<String, f64>) {
        self.baseline_phases = phases;
    }

    /// Runs work and books its CPU time to a phase of the observers.
    pub fn timed<R>(&mut self, phase: &'static str, work: impl FnOnce() -> R) -> R {
        let start = process::cpu_seconds();
        let result = work();
        *self.own_phases.entry(phase).or_insert(0.0) += process::cpu_seconds() - start;
        result
    }

    /// Cost so far, earlier attempts included.
    #[must_use]
    pub fn usage(&self) -> Usage {
        let peak = process::peak_resident_bytes(std::process::id()).unwrap_or(0);
        Usage {
            wall_s: self.baseline.wall_s + self.began.elapsed().as_secs_f64(),
            cpu_s: self.baseline.cpu_s + process::cpu_seconds() - self.cpu_began,
            peak_memory_bytes: self.baseline.peak_memory_bytes.max(peak),
            disk_bytes: self.baseline.disk_bytes,
        }
    }

    /// CPU seconds by phase so far, earlier attempts included.
    #[must_use]
    pub fn phases(&self, simulation: &dyn Simulation) -> BTreeMap<String, f64> {
        let mut total = self.baseline_phases.clone();
        for (name, seconds) in simulation.phases().seconds().iter().chain(&self.own_phases) {
            *total.entry((*name).to_owned()).or_insert(0.0) += seconds;
        }
        total
    }

    /// Past and forecast cost of phases that come at milestones; empty without a forecast.
    fn milestones(&self, simulation: &dyn Simulation) -> Vec<Milestone> {
        let Some(forecast) = &self.forecast else { return Vec::new() };
        let booked = self.phases(simulation);
        let rest = (self.usage().cpu_s - booked.values().sum::<f64>()).max(0.0);
        let spent = |phase: &String| if phase == REST { rest } else { booked.get(phase).copied().unwrap_or(0.0) };
        forecast.milestones.iter().map(|(phase, all)| Milestone { spent: spent(phase), all: *all }).collect()
    }

    /// Seconds to the end, and what they rest on: the steps that are left at the speed so far, and what the forecast has
    /// beside the steps (errors, frames) and was not spent yet, in the proportion that steps have to their forecast.
    fn time_left(
        &self,
        simulation: &dyn Simulation,
        done: u64,
        left: u64,
        seconds: f64,
    ) -> (Option<f64>, Option<String>) {
        let milestones = self.milestones(simulation);
        let clock_per_cpu = self.forecast.as_ref().map_or(1.0, |f| f.wall_s / f.cpu_s.max(1e-9));
        let beside = milestones.iter().map(|milestone| milestone.spent).sum::<f64>() - self.milestones_before;
        let per_step = (seconds - beside * clock_per_cpu).max(0.02 * seconds) / done as f64;
        let forecast_per_step = self.forecast.as_ref().map_or(0.0, |forecast| {
            let stepping = forecast.cpu_s - milestones.iter().map(|milestone| milestone.all).sum::<f64>();
            stepping * clock_per_cpu / simulation.end().step.max(1) as f64
        });
        // The first steps tell little: caches are cold, files are opened.
        let is_telling = seconds >= TELLING_S && forecast_per_step > 0.0;
        let pace = if is_telling { (per_step / forecast_per_step).clamp(0.5, 3.0) } else { 1.0 };
        let to_come: f64 = milestones.iter().map(|milestone| (milestone.all - milestone.spent).max(0.0)).sum();
        let eta = left as f64 * per_step + to_come * clock_per_cpu * pace;
        let basis = if milestones.is_empty() {
            format!("mean speed of the last {done} steps")
        } else {
            format!("mean speed of the last {done} steps, and the forecast of output and errors still to come")
        };
        (Some(eta), Some(basis))
    }

    /// Whether the last record is at least so old.
    #[must_use]
    pub fn is_silent_for(&self, time: Duration) -> bool {
        self.last.is_none_or(|last| last.elapsed() >= time)
    }

    /// A record of the present state, at most every 0.4 s unless it `must` be made.
    pub fn observe(&mut self, simulation: &dyn Simulation, findings: &FindingLog, must: bool) -> Option<Progress> {
        let clock = simulation.clock();
        if self.first_step.is_none() {
            self.first_step = Some(clock.step);
            self.stepping_since = Instant::now();
            self.milestones_before = self.milestones(simulation).iter().map(|milestone| milestone.spent).sum();
        } else if !must && self.last.is_some_and(|last| last.elapsed() < INTERVAL) {
            return None;
        }
        self.last = Some(Instant::now());
        let end = simulation.end();
        let done = clock.step - self.first_step.unwrap_or(0);
        let seconds = self.stepping_since.elapsed().as_secs_f64();
        let speed = (done > 0 && seconds > 0.0).then(|| done as f64 / seconds);
        let left = end.step - clock.step;
        let (eta_s, eta_basis) = match speed {
            Some(_) if left == 0 => (Some(0.0), None),
            Some(_) => self.time_left(simulation, done, left, seconds),
            None => (None, None),
        };
        Some(Progress {
            fraction: clock.step as f64 / end.step.max(1) as f64,
            time: clock.time,
            end_time: end.time,
            step: clock.step,
            steps_per_s: speed,
            particles: simulation.particle_count() as u64,
            phase: if simulation.is_finished() { "finishing" } else { "stepping" }.to_owned(),
            eta_s,
            eta_basis,
            health: findings.health(simulation.health()),
            usage: self.usage(),
        })
    }
}
