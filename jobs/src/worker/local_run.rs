//! One job in this process, on so many threads, for its report alone or its frames too.

use crate::spec::attempt_files;
use crate::spec::attempt_spec::AttemptSpec;
use crate::spec::body::{self, Allowance, JobBody, NoSources};
use crate::spec::records::{Record, RecordSink, Usage, Verdict};
use crate::spec::states::Reason;
use crate::system::process;
use crate::worker::attempt;
use crate::worker::observers::Control;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

/// What is left of a run beside its report, series and picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// Nothing: frames of large runs would fill the disk.
    Report,
    /// The frames, too.
    Frames,
}

/// Why a body was not run.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Refused {
    /// The first place that is wrong; empty where the directory cannot be used.
    pub pointer: String,
    /// All that is wrong.
    pub message: String,
}

impl From<io::Error> for Refused {
    fn from(error: io::Error) -> Self {
        Self { pointer: String::new(), message: error.to_string() }
    }
}

/// Why a run came to no success.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Ended {
    /// The reason of one that has failed; None of one that was not begun.
    pub reason: Option<Reason>,
    /// A sentence.
    pub message: String,
}

impl From<Ended> for String {
    fn from(ended: Ended) -> Self {
        ended.message
    }
}

/// Runs a job body into a directory, which is emptied before, and returns how it was understood.
///
/// # Errors
/// [`Ended`].
pub fn run(body: &Value, directory: &Path, threads: u64, keep: Keep) -> Result<JobBody, Ended> {
    let refused = |refused: Refused| Ended { reason: None, message: refused.message };
    let (body, verdict) = run_to_verdict(body, directory, threads, keep).map_err(refused)?;
    match verdict {
        Verdict::Succeeded => Ok(body),
        Verdict::Failed { reason, message, .. } => Err(Ended { reason: Some(reason), message }),
        other => Err(Ended { reason: None, message: format!("the run {other}") }),
    }
}

/// The same to its verdict, whatever that is.
///
/// # Errors
/// [`Refused`].
pub fn run_to_verdict(body: &Value, directory: &Path, threads: u64, keep: Keep) -> Result<(JobBody, Verdict), Refused> {
    let memory_bytes = process::total_memory().unwrap_or(4 << 30) / 5 * 4;
    let allowance = Allowance { threads, memory_bytes, local_files: false };
    let body = body::parse(body, allowance, &NoSources).map_err(|error| {
        let violations = error.violations();
        let lines: Vec<String> = violations.iter().map(|v| format!("{}: {}", v.pointer, v.detail)).collect();
        let pointer = violations.first().map_or_else(String::new, |first| first.pointer.clone());
        Refused { pointer, message: lines.join("; ") }
    })?;
    if body.wanted.is_some() {
        let message = "accuracy: a study chooses the spacing, which only the service runs; give a spacing".to_owned();
        return Err(Refused { pointer: "/accuracy".to_owned(), message });
    }
    if directory.exists() {
        fs::remove_dir_all(directory)?;
    }
    fs::create_dir_all(directory)?;
    let spec = AttemptSpec {
        job: "local".to_owned(),
        epoch: 1,
        body: body.resolved.to_json(),
        attempts_directory: directory.to_owned(),
        may_start_afresh: true,
        checkpoints: Vec::new(),
        inputs: BTreeMap::new(),
        time: None,
        reserve_bytes: 0,
        late_files_s: 0.0,
        usage: Usage::default(),
        submission: None,
    };
    let verdict = attempt::run_attempt(&spec, directory, &Control::default(), &mut Silent);
    if verdict == Verdict::Succeeded {
        let _ = fs::remove_dir_all(directory.join(attempt_files::CHECKPOINTS));
        if keep == Keep::Report {
            let _ = fs::remove_dir_all(directory.join(attempt_files::FRAMES));
        }
    }
    Ok((body, verdict))
}

struct Silent;

impl RecordSink for Silent {
    fn put(&mut self, _record: &Record, _durable: bool) -> io::Result<()> {
        Ok(())
    }
}
