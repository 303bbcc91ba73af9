//! How far a run is, how fast it goes, what it costs.

use crate::process;
use crate::records::{HealthRecord, Progress, Usage};
use meniscus::simulation::Simulation;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Least time between two records.
const INTERVAL: Duration = Duration::from_millis(400);

/// Measures and reports.
pub struct ProgressMeter {
    baseline: Usage,
    baseline_phases: BTreeMap<String, f64>,
    began: Instant,
    cpu_began: f64,
    own_phases: BTreeMap<&'static str, f64>,
    first_step: Option<u64>,
    stepping_since: Instant,
    last: Option<Instant>,
}

impl ProgressMeter {
    /// For an attempt that adds to what earlier ones cost.
    #[must_use]
    pub fn new(baseline: Usage, baseline_phases: BTreeMap<String, f64>) -> Self {
        let now = Instant::now();
        Self {
            baseline,
            baseline_phases,
            began: now,
            cpu_began: process::cpu_seconds(),
            own_phases: BTreeMap::new(),
            first_step: None,
            stepping_since: now,
            last: None,
        }
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

    /// A record of this moment, at most every 0.4 s unless it `must` be made.
    pub fn observe(&mut self, simulation: &dyn Simulation, must: bool) -> Option<Progress> {
        let clock = simulation.clock();
        if self.first_step.is_none() {
            self.first_step = Some(clock.step);
            self.stepping_since = Instant::now();
        } else if !must && self.last.is_some_and(|last| last.elapsed() < INTERVAL) {
            return None;
        }
        self.last = Some(Instant::now());
        let end = simulation.end();
        let done = clock.step - self.first_step.unwrap_or(0);
        let seconds = self.stepping_since.elapsed().as_secs_f64();
        let speed = (done > 0 && seconds > 0.0).then(|| done as f64 / seconds);
        let health = simulation.health();
        Some(Progress {
            fraction: clock.step as f64 / end.step.max(1) as f64,
            time: clock.time,
            end_time: end.time,
            step: clock.step,
            steps_per_s: speed,
            particles: simulation.particle_count() as u64,
            phase: if simulation.is_finished() { "finishing" } else { "stepping" }.to_owned(),
            eta_s: speed.map(|speed| (end.step - clock.step) as f64 / speed),
            eta_basis: speed.map(|_| format!("mean speed of the last {done} steps")),
            health: HealthRecord {
                finite: health.finite,
                max_cfl: health.max_cfl,
                volume_drift: health.volume_drift,
                rescued_fits: health.rescued_fits,
            },
            usage: self.usage(),
        })
    }
}
