//! Records: what a worker tells the service, one JSON line each, appended to `records.jsonl` of its attempt and
//! stamped with the attempt's epoch. A line counts only when it is whole and its epoch is the job's.

use super::health::HealthRecord;
use crate::spec::attempt_files;
use crate::system::digest;
use meniscus::simulation::Finding;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// A line of `records.jsonl`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Line {
    /// The attempt's epoch.
    pub epoch: u64,
    /// When it was written.
    pub at: String,
    /// The record.
    pub record: Record,
}

/// What happened in a worker.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Record {
    /// The simulation stands ready, from a checkpoint or from the start.
    Started {
        /// Step it goes on from.
        step: u64,
        /// Frames that precede it; later ones of older attempts are void.
        frames: u64,
        /// Whether a checkpoint was used.
        from_checkpoint: bool,
        /// Pid of the worker.
        pid: u32,
    },
    /// What is being done, before there is any progress.
    Phase {
        /// Name of the phase.
        phase: String,
    },
    /// How far it is.
    Progress(Progress),
    /// A file was written in place.
    File(FileRecord),
    /// A checkpoint was written and verified.
    Checkpoint(CheckpointRecord),
    /// Something to know.
    Warning {
        /// A short word.
        code: String,
        /// A sentence.
        message: String,
    },
    /// Something that the run noticed.
    Finding(Finding),
    /// The last word of the worker.
    Verdict(Verdict),
}

/// How far a run is.
#[derive(Debug, Clone, Default, Serialize, Deserialize, PartialEq)]
pub struct Progress {
    /// 0 to 1.
    pub fraction: f64,
    /// Scene time reached so far.
    pub time: f64,
    /// Scene time at the end.
    pub end_time: f64,
    /// Steps done so far.
    pub step: u64,
    /// Speed of late.
    pub steps_per_s: Option<f64>,
    /// Number of particles.
    pub particles: u64,
    /// What is being done.
    pub phase: String,
    /// Seconds to the end.
    pub eta_s: Option<f64>,
    /// What the estimate rests on.
    pub eta_basis: Option<String>,
    /// Health, its findings left out.
    pub health: HealthRecord,
    /// Cost of the job so far, over all attempts.
    pub usage: Usage,
}

/// Cost of a job.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, PartialEq)]
pub struct Usage {
    /// Running time in seconds.
    pub wall_s: f64,
    /// CPU time in seconds.
    pub cpu_s: f64,
    /// Most resident memory.
    pub peak_memory_bytes: u64,
    /// Size of all files.
    pub disk_bytes: u64,
}

/// A file in the attempt's directory.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
pub struct FileRecord {
    /// Path among the job's files, and below the attempt's directory.
    pub path: String,
    /// Size in bytes.
    pub size_bytes: u64,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Media type of the file.
    pub media_type: String,
    /// Scene time, of frames.
    pub time: Option<f64>,
    /// Step, of frames.
    pub step: Option<u64>,
}

impl FileRecord {
    /// The record of a finished file below an attempt's directory.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn from_file(directory: &Path, path: &str, media_type: &str) -> io::Result<Self> {
        let (sha256, size_bytes) = digest::of_file(&directory.join(path))?;
        let (path, media_type) = (path.to_owned(), media_type.to_owned());
        Ok(Self { path, size_bytes, sha256, media_type, time: None, step: None })
    }
}

/// A checkpoint in the attempt's directory.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
pub struct CheckpointRecord {
    /// Id of the checkpoint.
    pub id: String,
    /// Path below the attempt's directory.
    pub path: String,
    /// Step of the simulation.
    pub step: u64,
    /// Scene time of that step.
    pub time: f64,
    /// Size in bytes.
    pub size_bytes: u64,
    /// Digest of the file.
    pub sha256: String,
    /// Instruction set that it was written on.
    pub isa: String,
    /// Program that wrote it.
    pub build: String,
}

/// How a worker ended.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum Verdict {
    /// The end of the scene, everything published.
    Succeeded,
    /// A checkpoint at the end of a step, on request or for want of space.
    Paused {
        /// Why, if not on request.
        reason: Option<crate::spec::states::Reason>,
    },
    /// The step was dropped on request.
    Canceled,
    /// The system did not grant what a worker needs to begin. It is no record: the exit code of the worker says so.
    Unstarted {
        /// What the system said.
        cause: String,
    },
    /// It cannot go on.
    Failed {
        /// Reason of the failure.
        reason: crate::spec::states::Reason,
        /// With numbers and places.
        message: String,
    },
}

impl fmt::Display for Verdict {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Succeeded => formatter.write_str("succeeded"),
            Self::Paused { reason: None } => formatter.write_str("paused on request"),
            Self::Paused { reason: Some(reason) } => write!(formatter, "paused ({})", reason.word()),
            Self::Canceled => formatter.write_str("canceled"),
            Self::Unstarted { cause } => write!(formatter, "not started: {cause}"),
            Self::Failed { reason, message } => write!(formatter, "failed ({}): {message}", reason.word()),
        }
    }
}

/// Where a worker's records go.
pub trait RecordSink: Send {
    /// Takes a record; it is safe on disk when this returns if `durable`.
    ///
    /// # Errors
    /// When it cannot be written.
    fn put(&mut self, record: &Record, durable: bool) -> io::Result<()>;
}

/// Appends to `records.jsonl`.
#[derive(Debug)]
pub struct RecordFile {
    file: File,
    epoch: u64,
}

impl RecordFile {
    /// Opens the file of an attempt.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn open(directory: &Path, epoch: u64) -> io::Result<Self> {
        let file = OpenOptions::new().create(true).append(true).open(directory.join(attempt_files::RECORDS))?;
        Ok(Self { file, epoch })
    }
}

impl RecordSink for RecordFile {
    fn put(&mut self, record: &Record, durable: bool) -> io::Result<()> {
        let line = Line { epoch: self.epoch, at: crate::system::clock::now(), record: record.clone() };
        let mut text = serde_json::to_vec(&line)?;
        text.push(b'\n');
        self.file.write_all(&text)?;
        if durable { self.file.sync_data() } else { Ok(()) }
    }
}

/// The whole lines behind `offset`, each with the offset behind it. A line that is still being written is left.
///
/// # Errors
/// When the file is there but cannot be read.
pub fn read_from(directory: &Path, offset: u64) -> io::Result<Vec<(Option<Line>, u64)>> {
    let mut file = match File::open(directory.join(attempt_files::RECORDS)) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error),
    };
    file.seek(SeekFrom::Start(offset))?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    let mut lines = Vec::new();
    let mut end = offset;
    for chunk in bytes.split_inclusive(|b| *b == b'\n') {
        if chunk.last() != Some(&b'\n') {
            break;
        }
        end += chunk.len() as u64;
        // A damaged line is skipped like one of a foreign epoch.
        let parsed = serde_json::from_slice::<Value>(chunk).ok().and_then(|v| serde_json::from_value(v).ok());
        lines.push((parsed, end));
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::{Record, RecordFile, RecordSink, Verdict, read_from};
    use std::io::Write;

    #[test]
    fn whole_lines_are_read_once_and_torn_ones_wait() {
        let directory = tempfile::tempdir().unwrap();
        let mut records = RecordFile::open(directory.path(), 3).unwrap();
        records.put(&Record::Warning { code: "a".into(), message: "b".into() }, true).unwrap();
        let first = read_from(directory.path(), 0).unwrap();
        assert_eq!(first.len(), 1);
        records.file.write_all(b"{\"epoch\": 3, \"at\"").unwrap();
        assert!(read_from(directory.path(), first[0].1).unwrap().is_empty());
        records.file.write_all(b": torn}\n").unwrap();
        records.put(&Record::Verdict(Verdict::Canceled), true).unwrap();
        let rest = read_from(directory.path(), first[0].1).unwrap();
        assert_eq!(rest.len(), 2);
        assert!(rest[0].0.is_none());
        assert_eq!(rest[1].0.as_ref().unwrap().epoch, 3);
    }
}
