//! What a run will take, before it is made: particles, steps, memory, disk, and time by what was measured before.

use crate::spec::calibration::{Calibration, Measured, PhaseMeasured, TimeForecast, wall_phase};
use crate::spec::json_numbers::{null_is_zero, nulls_are_zero};
use crate::spec::report::Cost;
use crate::spec::run_options::{OperatorFormat, RunOptions};
use meniscus::scene::{Estimate, PhaseWork, Scene};
use meniscus::scenes::work_estimate;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Memory of a worker before it holds any particle.
pub const WORKER_BASE_BYTES: u64 = 20 << 20;

/// Rows of a chunk at most in the data sets of frames and checkpoints.
pub const CHUNK_ROWS: usize = 1 << 16;

/// The size and the cost of a run.
#[derive(Debug, Clone)]
pub struct Forecast {
    /// Size of the run: particles, steps, time step.
    pub estimate: Estimate,
    /// Work by phase.
    pub work: Vec<PhaseWork>,
    /// Kind, dimension and method: runs of one family are compared.
    pub family: String,
    /// Threads of the run.
    pub threads: u64,
    /// Resident memory of the worker.
    pub memory_bytes: u64,
    /// Size of all files.
    pub disk_bytes: u64,
    /// Time, where there is something to judge it by.
    pub time: Option<TimeForecast>,
}

impl Forecast {
    /// Looks up what the work takes on this machine.
    pub fn time_by(&mut self, calibration: &Calibration) {
        self.time = calibration.time(&self.family, &self.work, self.threads);
    }

    /// Measurements on which the estimated times rest.
    #[must_use]
    pub fn basis(&self) -> &str {
        self.time.as_ref().map_or("nothing was measured on this machine yet", |time| &time.basis)
    }

    /// The forecast as it stands in the store.
    #[must_use]
    pub fn record(&self) -> ForecastRecord {
        ForecastRecord {
            particles: self.estimate.particles,
            steps: self.estimate.steps,
            time_step: self.estimate.time_step,
            end_time: self.estimate.end_time,
            memory_bytes: self.memory_bytes,
            disk_bytes: self.disk_bytes,
            cpu_s: self.time.as_ref().map(|time| time.cpu_s),
            wall_s: self.time.as_ref().map(|time| time.wall_s),
            basis: self.basis().to_owned(),
            time: self.time.clone(),
            family: self.family.clone(),
            work: self.work.iter().map(|phase| (phase.phase.to_owned(), phase.units)).collect(),
        }
    }
}

/// A forecast as it stands in the store. Rows of earlier builds may lack some of it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ForecastRecord {
    /// Number of particles.
    pub particles: u64,
    /// Steps to the end.
    pub steps: u64,
    /// Scene time of a step.
    #[serde(deserialize_with = "null_is_zero")]
    pub time_step: f64,
    /// Scene time at the end.
    #[serde(deserialize_with = "null_is_zero")]
    pub end_time: f64,
    /// Resident memory of the worker.
    pub memory_bytes: u64,
    /// Size of all files.
    pub disk_bytes: u64,
    /// CPU seconds, if they can be estimated.
    pub cpu_s: Option<f64>,
    /// Running time in seconds.
    pub wall_s: Option<f64>,
    /// Measurements on which it rests.
    pub basis: String,
    /// Time, as a worker needs it.
    pub time: Option<TimeForecast>,
    /// Kind, dimension and method: runs of one family are compared.
    pub family: String,
    /// Units of work by phase.
    #[serde(deserialize_with = "nulls_are_zero")]
    pub work: BTreeMap<String, f64>,
}

/// What a finished run tells of the machine: its work as forecast, and the phases of its report.
#[must_use]
pub fn measured(forecast: &ForecastRecord, cost: &Cost, threads: u64) -> Vec<PhaseMeasured> {
    let family = &forecast.family;
    let seconds = |phase: &str| cost.phases.get(phase).copied().unwrap_or(0.0);
    let cpu_s = cost.cpu_s;
    let rest = cpu_s - cost.phases.values().sum::<f64>();
    let phase = |(phase, work): (&String, &f64)| {
        let seconds = if phase == work_estimate::REST { rest.max(0.0) } else { seconds(phase) };
        PhaseMeasured { family: family.clone(), phase: phase.clone(), measured: Measured { work: *work, seconds } }
    };
    let mut found: Vec<PhaseMeasured> = forecast.work.iter().filter(|(_, units)| **units > 0.0).map(phase).collect();
    if cpu_s > 0.0 {
        let measured = Measured { work: cpu_s, seconds: cost.wall_s };
        found.push(PhaseMeasured { family: family.clone(), phase: wall_phase(threads), measured });
    }
    found
}

/// Bytes of all files of a run: its frames, its series, its picture, and its checkpoints: the last one, and where they come by
/// steps as many as are kept.
pub(crate) fn disk_bytes(scene: &dyn Scene, estimate: &Estimate, options: &RunOptions) -> u64 {
    const FILE: u64 = 24 << 10;
    const CHUNK: u64 = CHUNK_ROWS as u64;
    let plan = options.plan();
    let frames = work_estimate::frames(estimate.steps, estimate.end_time, &plan) as u64;
    // Topology, position and the fields that were chosen; vectors and numbers weigh alike here.
    let fields = options.output.fields.len() as u64;
    let frame = 40 + 14 * fields;
    let written = if options.checkpoint.every_steps.is_some() { options.checkpoint.keep } else { 1 };
    // Data sets grow by whole chunks: a part of the last stays empty.
    let rows_of = estimate.particles;
    let rows_of = if rows_of > CHUNK { rows_of.saturating_add(CHUNK / 4) } else { rows_of };
    let state = rows_of.saturating_mul(STATE_BYTES);
    let frames_bytes = rows_of.saturating_mul(frame).saturating_add(FILE).saturating_mul(frames);
    let rows = estimate.steps / plan.series_every_steps.max(1) + 2;
    let checkpoints_bytes = state.saturating_add(FILE).saturating_mul(written);
    // A picture shows every particle of the plane three times over, and a slice through those of space.
    // Two indices and seventeen digits, or a double and an index of eight bytes.
    let entry = match options.output.operators {
        Some(OperatorFormat::MatrixMarket) => 40.0,
        Some(OperatorFormat::Npz) => 16.0,
        None => 0.0,
    };
    let operators = (entry * scene.operator_entries(estimate)) as u64;
    let picture = estimate.particles.saturating_mul(if scene.dimension() == 2 { 225 } else { 6 });
    // SQLite's whole numbers end at 2⁶³.
    frames_bytes
        .saturating_add(checkpoints_bytes)
        .saturating_add(rows.saturating_mul(160))
        .saturating_add(picture)
        .saturating_add(operators)
        .saturating_add(40 << 10)
        .min(1 << 62)
}

/// Bytes of a particle in a checkpoint.
const STATE_BYTES: u64 = 90;

#[cfg(test)]
mod tests {
    use super::ForecastRecord;
    use serde_json::json;

    #[test]
    fn what_an_earlier_build_stored_is_read_and_comes_back() {
        let record = json!({
            "particles": 10, "steps": 20, "time_step": 0.1, "end_time": 2.0, "memory_bytes": 1, "disk_bytes": 2, "cpu_s": 3.0,
            "wall_s": null, "basis": "b", "family": "vortex/2", "work": {"fits": 5.0},
            "time": {"cpu_s": 3.0, "wall_s": 1.5, "moments": {"errors": 0.5}, "basis": "b"},
        });
        let read: ForecastRecord = serde_json::from_value(record).unwrap();
        assert_eq!(read.time.as_ref().unwrap().milestones["errors"], 0.5);
        let again: ForecastRecord = serde_json::from_str(&serde_json::to_string(&read).unwrap()).unwrap();
        assert_eq!(again, read);
        let infinite = ForecastRecord { end_time: f64::INFINITY, ..read };
        let again: ForecastRecord = serde_json::from_str(&serde_json::to_string(&infinite).unwrap()).unwrap();
        assert_eq!(again.end_time, 0.0);
        assert_eq!(serde_json::from_str::<ForecastRecord>("{}").unwrap(), ForecastRecord::default());
    }
}
