//! What a run will take, before it is made: particles, steps, memory, disk, and time by what was measured before.

use crate::formats::hdf5_file::CHUNK_ROWS;
use crate::spec::calibration::Calibration;
use crate::spec::run_options::RunOptions;
use meniscus::scene::{Estimate, PhaseWork};
use meniscus::scenes::work_estimate;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Memory of a worker before it holds any particle.
pub const WORKER_BASE_BYTES: u64 = 20 << 20;

/// The size and the cost of a run.
#[derive(Debug, Clone)]
pub struct Forecast {
    /// Size.
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

/// How long a run will take.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TimeForecast {
    /// CPU seconds.
    pub cpu_s: f64,
    /// Seconds by the clock.
    pub wall_s: f64,
    /// CPU seconds of phases that come at some moments, not with every step.
    pub moments: BTreeMap<String, f64>,
    /// What it rests on.
    pub basis: String,
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

    /// As it stands in the store and in answers.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let work: Map<String, Value> =
            self.work.iter().map(|phase| (phase.phase.to_owned(), json!(phase.units))).collect();
        json!({
            "particles": self.estimate.particles,
            "steps": self.estimate.steps,
            "time_step": self.estimate.time_step,
            "end_time": self.estimate.end_time,
            "memory_bytes": self.memory_bytes,
            "disk_bytes": self.disk_bytes,
            "cpu_s": self.time.as_ref().map(|time| time.cpu_s),
            "wall_s": self.time.as_ref().map(|time| time.wall_s),
            "basis": self.basis(),
            "time": self.time,
            "family": self.family,
            "work": work,
        })
    }
}

/// Bytes of all files of a run: its frames, its series, its picture, and its checkpoints: the last one, and where they come by
/// steps as many as are kept.
pub(crate) fn disk_bytes(dimension: usize, estimate: &Estimate, options: &RunOptions) -> u64 {
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
    let picture = estimate.particles.saturating_mul(if dimension == 2 { 225 } else { 6 });
    // SQLite's whole numbers end at 2⁶³.
    frames_bytes
        .saturating_add(checkpoints_bytes)
        .saturating_add(rows.saturating_mul(160))
        .saturating_add(picture)
        .saturating_add(40 << 10)
        .min(1 << 62)
}

/// Bytes of a particle in a checkpoint.
const STATE_BYTES: u64 = 90;
