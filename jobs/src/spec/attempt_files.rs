//! Names of the files that a worker leaves in its attempt's directory. They are part of the paths that clients see.

use std::path::{Path, PathBuf};

/// The attempt's specification, written by the service.
pub const ATTEMPT_SPEC: &str = "attempt.json";
/// What the worker tells the service, a line of JSON each.
pub const RECORDS: &str = "records.jsonl";
/// The worker's log, and what it writes to its standard error.
pub const LOG: &str = "log.txt";
/// Observables over time.
pub const SERIES: &str = "series.csv";
/// Errors and cost of a finished run.
pub const REPORT: &str = "report.json";
/// The first, the middle and the last frame side by side.
pub const PICTURE: &str = "picture.svg";
/// Digests of all files of a finished run.
pub const DIGESTS: &str = "SHA256SUMS";
/// Folder of the frames.
pub const FRAMES: &str = "frames";
/// Folder of the checkpoints.
pub const CHECKPOINTS: &str = "checkpoints";
/// Ending of a frame's name, which is otherwise its number.
pub const FRAME_ENDING: &str = "vtkhdf";
/// Ending of a checkpoint's name, which is otherwise its step.
pub const CHECKPOINT_ENDING: &str = "h5";

/// Requests to a worker without a pipe, a word a line, appended by the service.
pub const CONTROL: &str = "control";
/// Sign of life of a worker without a pipe, written anew by it: [`super::heartbeat::Heartbeat`].
pub const HEARTBEAT: &str = "heartbeat.json";
/// The script that a cluster runs.
pub const SCRIPT: &str = "slurm.sh";
/// In which bundle of short attempts it is.
pub const BUNDLE: &str = "bundle.json";
/// Folder that the one process which may work on the attempt makes before anything else.
pub const CLAIM: &str = "claim";
/// File in it: which cluster job made it.
pub const CLAIM_OWNER: &str = "owner";

/// Mark in the name of a checkpoint that was written before the measurements and the output of its step.
pub const UNMEASURED: &str = "-unmeasured";

/// Media type of frames and checkpoints.
pub const HDF5_MEDIA_TYPE: &str = "application/x-hdf5";

/// The directory of one attempt of a job.
#[must_use]
pub fn attempt_directory(job_directory: &Path, epoch: u64) -> PathBuf {
    job_directory.join("attempts").join(epoch.to_string())
}
