//! What a resolved body asks of a run beside its scene.

use meniscus::simulation::OutputPlan;
use serde::Deserialize;
use serde_json::Value;

/// What a resolved body asks of the run: everything but the scene.
#[derive(Debug, Clone, Deserialize)]
pub struct Wishes {
    /// Output section.
    pub output: Output,
    /// Checkpoint section.
    pub checkpoint: CheckpointWishes,
    /// Limits section.
    pub limits: Limits,
}

/// What to write.
#[derive(Debug, Clone, Deserialize)]
pub struct Output {
    /// A frame at every multiple of this time.
    pub every_time: Option<f64>,
    /// Fields of frames.
    pub fields: Vec<String>,
    /// A series row every so many steps.
    pub series_every_steps: u64,
}

/// When to write checkpoints.
#[derive(Debug, Clone, Deserialize)]
pub struct CheckpointWishes {
    /// By the wall clock.
    pub every_wall_s: Option<f64>,
    /// By steps.
    pub every_steps: Option<u64>,
    /// How many to keep.
    pub keep: u64,
}

/// Limits of a job.
#[derive(Debug, Clone, Deserialize)]
pub struct Limits {
    /// Running time until the job is paused.
    pub wall_s: Option<f64>,
    /// Resident memory.
    pub memory_bytes: u64,
    /// Size of all files.
    pub disk_bytes: Option<f64>,
    /// Threads.
    pub threads: u64,
}

impl Wishes {
    /// From a resolved body.
    ///
    /// # Errors
    /// When it is not one.
    pub fn of(resolved: &Value) -> Result<Self, serde_json::Error> {
        Self::deserialize(resolved)
    }

    /// The plan that the engine sees.
    #[must_use]
    pub fn plan(&self) -> OutputPlan {
        OutputPlan { every_time: self.output.every_time, series_every_steps: self.output.series_every_steps }
    }
}
