//! The specification of an attempt, from which a worker learns what to do: `attempt.json` in the attempt's directory.

use crate::spec::calibration::TimeForecast;
use crate::spec::forecast::ForecastRecord;
use crate::spec::records::Usage;
use meniscus::simulation::Finding;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Everything that a worker needs to know.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct AttemptSpec {
    /// Id of the job.
    pub job: String,
    /// The attempt's number, the fence of its records.
    pub epoch: u64,
    /// The job's resolved body.
    pub body: Value,
    /// Directory of all attempts; paths in checkpoints start here.
    pub attempts_directory: PathBuf,
    /// What to begin with, newest first.
    pub checkpoints: Vec<StartCheckpoint>,
    /// Whether the start of the scene will do when no checkpoint is sound.
    pub may_start_afresh: bool,
    /// Points that the scene takes from uploads, by their ids, in the format of [`crate::formats::cloud_file`].
    #[serde(default)]
    pub inputs: BTreeMap<String, PathBuf>,
    /// What the run was forecast to take.
    #[serde(default)]
    pub time: Option<TimeForecast>,
    /// Free space that the worker leaves untouched: the service needs it to write down what happened.
    #[serde(default)]
    pub reserve_bytes: u64,
    /// Time in seconds that a file of an earlier attempt may take to be seen on the machine that runs this one.
    #[serde(default)]
    pub late_files_s: f64,
    /// Cost of the attempts before.
    pub usage: Usage,
    /// What the worker does not need: by it the job comes back into a database that was lost.
    #[serde(default)]
    pub submission: Option<Submission>,
}

/// What the database has of a job beside its resolved body.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Submission {
    /// Body as sent.
    pub spec: Value,
    /// What the run was forecast to take.
    pub forecast: ForecastRecord,
    /// What was doubtful before it ran.
    pub warnings: Vec<Finding>,
    /// Time at which it was made.
    pub created_at: Option<String>,
    /// Time at which it first started.
    pub started_at: Option<String>,
    /// Name of the token that made it.
    pub owner: Option<String>,
    /// Study that it is a point of, with the number of the point.
    pub study: Option<(String, u64)>,
    /// Job that it repeats.
    pub retry_of: Option<String>,
}

/// A checkpoint to begin with.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StartCheckpoint {
    /// Id of the checkpoint.
    pub id: String,
    /// Path of its file.
    pub path: PathBuf,
    /// Its digest, where it is known.
    pub sha256: Option<String>,
    /// Whether it was written by this job: then output goes on without repeating that of its step.
    pub is_own: bool,
    /// Whether another instruction set is acceptable.
    pub allow_other_isa: bool,
}
