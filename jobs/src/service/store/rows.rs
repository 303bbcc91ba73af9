//! Rows of the store as values.

use super::StoreError;
use crate::formats::frame_index;
use crate::spec::forecast::ForecastRecord;
use crate::spec::health::{Finding, HealthStatus};
use crate::spec::records::{Progress, Usage, Verdict};
use crate::spec::report::Results;
use crate::spec::states::{Reason, State};
use crate::system::digest;
use rusqlite::{Connection, OptionalExtension, Row};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// A job as the store has it.
#[derive(Debug, Clone, PartialEq)]
pub struct JobRow {
    /// Id of the job.
    pub id: String,
    /// Counts changes of state.
    pub rev: i64,
    /// State of the job.
    pub state: State,
    /// Reason of the state, if it has one.
    pub reason: Option<Reason>,
    /// What a user can do about it.
    pub hint: Option<String>,
    /// Numbers and places of a failure, in a sentence.
    pub message: Option<String>,
    /// Name, for people.
    pub name: Option<String>,
    /// Labels, for filters.
    pub labels: BTreeMap<String, String>,
    /// Kind of the scene.
    pub kind: String,
    /// Body as sent.
    pub spec: Value,
    /// Body with every default.
    pub resolved: Value,
    /// What the run was forecast to take.
    pub forecast: ForecastRecord,
    /// Priority: higher goes first.
    pub priority: i64,
    /// Time at which it was made.
    pub created_at: String,
    /// Time at which it first started.
    pub started_at: Option<String>,
    /// Time at which it came to a terminal state.
    pub finished_at: Option<String>,
    /// Number of the latest attempt: the epoch.
    pub attempt: u64,
    /// Workers that died in a row without a new checkpoint.
    pub deaths: u32,
    /// What the latest attempt waits for in its executor's queue.
    pub waiting_for: Option<String>,
    /// Bytes of the attempt's records that are imported.
    pub records_offset: u64,
    /// Whether this attempt has made a checkpoint.
    pub has_new_checkpoint: bool,
    /// Handle of the latest attempt's worker, as its executor gave it.
    pub worker_handle: Option<String>,
    /// The verdict of this attempt's worker, once it has come.
    pub verdict: Option<Verdict>,
    /// Why the service killed the worker, written before it did.
    pub kill_reason: Option<Reason>,
    /// Progress as last reported.
    pub progress: Progress,
    /// Counts changes of progress.
    pub progress_count: i64,
    /// What was known before it ran, and remarks of the service.
    pub warnings: Vec<Finding>,
    /// What its run noticed.
    pub findings: Vec<Finding>,
    /// Whether its results can be trusted; none before the first look.
    pub health: Option<HealthStatus>,
    /// Cost so far, over all attempts.
    pub usage: Usage,
    /// Running time at the last resume.
    pub leg_wall_s: f64,
    /// Checkpoint of another job that this one began with.
    pub restarted_from: Option<String>,
    /// Digest of that checkpoint's file.
    pub restart_sha256: Option<String>,
    /// Study that it is a point of.
    pub study: Option<String>,
    /// Number of the point.
    pub study_index: Option<u64>,
    /// Job that it repeats.
    pub retry_of: Option<String>,
    /// Name of the token that made it; None without tokens.
    pub owner: Option<String>,
    /// Jobs that it starts after.
    pub predecessors: Vec<String>,
    /// How many of them have not succeeded yet.
    pub waits_for: u64,
    /// Job whose last checkpoint it begins with, which is taken when it starts.
    pub restart_job: Option<String>,
    /// The study of its own that finds its spacing.
    pub awaits: Option<String>,
    /// Errors and cost, once it has succeeded.
    pub results: Option<Results>,
}

impl JobRow {
    /// Bytes that its files will still need, beside what is there.
    #[must_use]
    pub fn disk_bytes_to_come(&self) -> u64 {
        self.forecast.disk_bytes.saturating_sub(self.usage.disk_bytes)
    }
}

/// A published file.
#[derive(Debug, Clone, PartialEq)]
pub struct FileRow {
    /// Path among the job's files.
    pub path: String,
    /// Attempt that wrote it.
    pub attempt: u64,
    /// Size in bytes.
    pub size_bytes: u64,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Media type of the file.
    pub media_type: String,
    /// Scene time of a frame.
    pub time: Option<f64>,
    /// Step of the simulation.
    pub step: Option<u64>,
    /// The whole content, where no attempt has written it.
    pub content: Option<String>,
}

/// A verified checkpoint.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckpointRow {
    /// Id of the checkpoint.
    pub id: String,
    /// Job that wrote it.
    pub job: String,
    /// Attempt that wrote it.
    pub attempt: u64,
    /// Path below the attempt's directory.
    pub path: String,
    /// Step of the simulation.
    pub step: u64,
    /// Scene time of that step.
    pub time: f64,
    /// Size in bytes.
    pub size_bytes: u64,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Time at which it was imported.
    pub created_at: String,
    /// Instruction set that it was written on.
    pub isa: String,
    /// Program that wrote it.
    pub build: String,
}

pub(super) fn json<T: serde::de::DeserializeOwned + Default>(row: &Row, column: &str) -> rusqlite::Result<T> {
    let text: Option<String> = row.get(column)?;
    text.map_or_else(
        || Ok(T::default()),
        |text| {
            serde_json::from_str(&text).map_err(|error| {
                rusqlite::Error::FromSqlConversionFailure(0, rusqlite::types::Type::Text, Box::new(error))
            })
        },
    )
}

/// A remark of the service; version 0.1 kept the message alone.
#[derive(Deserialize)]
#[serde(untagged)]
enum Remark {
    Whole(Finding),
    Message(String),
}

impl From<Remark> for Finding {
    fn from(remark: Remark) -> Self {
        match remark {
            Remark::Whole(finding) => finding,
            Remark::Message(message) => Self::warning("service", message, (0, 0.0)),
        }
    }
}

pub(super) fn job_of(row: &Row) -> rusqlite::Result<JobRow> {
    let state: String = row.get("state")?;
    let reason: Option<String> = row.get("reason")?;
    Ok(JobRow {
        id: row.get("id")?,
        rev: row.get("rev")?,
        state: State::from_word(&state).ok_or(rusqlite::Error::InvalidQuery)?,
        reason: reason.as_deref().and_then(Reason::from_word),
        hint: row.get("hint")?,
        message: row.get("message")?,
        name: row.get("name")?,
        labels: json(row, "labels")?,
        kind: row.get("kind")?,
        spec: json(row, "spec")?,
        resolved: json(row, "resolved")?,
        forecast: json(row, "estimate")?,
        priority: row.get("priority")?,
        created_at: row.get("created_at")?,
        started_at: row.get("started_at")?,
        finished_at: row.get("finished_at")?,
        attempt: row.get::<_, i64>("attempt")? as u64,
        deaths: row.get("deaths")?,
        waiting_for: row.get("waiting_for")?,
        records_offset: row.get::<_, i64>("records_offset")? as u64,
        has_new_checkpoint: row.get::<_, i64>("checkpoint_since")? != 0,
        worker_handle: row.get("worker_handle")?,
        verdict: json(row, "verdict")?,
        kill_reason: row.get::<_, Option<String>>("kill_reason")?.as_deref().and_then(Reason::from_word),
        progress: json(row, "progress")?,
        progress_count: row.get("progress_count")?,
        warnings: json::<Vec<Remark>>(row, "warnings")?.into_iter().map(Finding::from).collect(),
        findings: json(row, "findings")?,
        health: row.get::<_, Option<String>>("health")?.as_deref().and_then(HealthStatus::from_word),
        usage: json(row, "usage")?,
        leg_wall_s: row.get("leg_wall_s")?,
        restarted_from: row.get("restarted_from")?,
        restart_sha256: row.get("restart_sha256")?,
        study: row.get("study")?,
        study_index: row.get::<_, Option<i64>>("study_index")?.map(|index| index as u64),
        retry_of: row.get("retry_of")?,
        owner: row.get("owner")?,
        predecessors: json(row, "predecessors")?,
        waits_for: row.get::<_, i64>("waits_for")? as u64,
        restart_job: row.get("restart_job")?,
        awaits: row.get("awaits")?,
        results: json(row, "results")?,
    })
}

/// A query of whole rows of jobs.
pub(super) fn select_jobs(which: &str) -> String {
    format!(
        "SELECT jobs.*, (SELECT COUNT(*) FROM dependencies WHERE dependencies.job = jobs.id) AS waits_for FROM jobs WHERE {which}"
    )
}

pub(super) fn job(connection: &Connection, id: &str) -> Result<Option<JobRow>, StoreError> {
    Ok(connection.prepare_cached(&select_jobs("id = ?1"))?.query_row([id], job_of).optional()?)
}

fn checkpoint_of(row: &Row) -> rusqlite::Result<CheckpointRow> {
    Ok(CheckpointRow {
        id: row.get("id")?,
        job: row.get("job")?,
        attempt: row.get::<_, i64>("attempt")? as u64,
        path: row.get("path")?,
        step: row.get::<_, i64>("step")? as u64,
        time: row.get("time")?,
        size_bytes: row.get::<_, i64>("size_bytes")? as u64,
        sha256: row.get("sha256")?,
        created_at: row.get("created_at")?,
        isa: row.get("isa")?,
        build: row.get("build")?,
    })
}

pub(super) fn checkpoint(connection: &Connection, id: &str) -> Result<Option<CheckpointRow>, StoreError> {
    Ok(connection
        .prepare_cached("SELECT * FROM checkpoints WHERE id = ?1")?
        .query_row([id], checkpoint_of)
        .optional()?)
}

pub(super) fn checkpoints(connection: &Connection, job: &str) -> Result<Vec<CheckpointRow>, StoreError> {
    let mut statement = connection
        .prepare_cached("SELECT * FROM checkpoints WHERE job = ?1 ORDER BY step DESC, attempt DESC, id DESC")?;
    let rows = statement.query_map([job], checkpoint_of)?;
    Ok(rows.collect::<Result<_, _>>()?)
}

fn file_of(row: &Row) -> rusqlite::Result<FileRow> {
    Ok(FileRow {
        path: row.get("path")?,
        attempt: row.get::<_, i64>("attempt")? as u64,
        size_bytes: row.get::<_, i64>("size_bytes")? as u64,
        sha256: row.get("sha256")?,
        media_type: row.get("media_type")?,
        time: row.get("time")?,
        step: row.get::<_, Option<i64>>("step")?.map(|step| step as u64),
        content: None,
    })
}

/// All files of a job by path, the index of its frames included as long as no attempt has written one.
pub(super) fn files(connection: &Connection, job: &str) -> Result<Vec<FileRow>, StoreError> {
    let mut statement = connection.prepare_cached("SELECT * FROM files WHERE job = ?1 ORDER BY path")?;
    let rows = statement.query_map([job], file_of)?;
    let mut files = rows.collect::<Result<Vec<FileRow>, _>>()?;
    let place = files.binary_search_by(|file| file.path.as_str().cmp(frame_index::PATH));
    if let Err(place) = place
        && files.iter().any(|file| file.step.is_some())
    {
        let frames = files.iter().filter(|file| file.step.is_some());
        let content = frame_index::text(frames.map(|frame| (frame.path.as_str(), frame.time)));
        let index = FileRow {
            path: frame_index::PATH.to_owned(),
            attempt: 0,
            size_bytes: content.len() as u64,
            sha256: digest::of_bytes(content.as_bytes()),
            media_type: frame_index::MEDIA_TYPE.to_owned(),
            time: None,
            step: None,
            content: Some(content),
        };
        files.insert(place, index);
    }
    Ok(files)
}

/// One file of a job.
pub(super) fn file(connection: &Connection, job: &str, path: &str) -> Result<Option<FileRow>, StoreError> {
    if path == frame_index::PATH {
        return Ok(files(connection, job)?.into_iter().find(|file| file.path == path));
    }
    let mut statement = connection.prepare_cached("SELECT * FROM files WHERE job = ?1 AND path = ?2")?;
    Ok(statement.query_row([job, path], file_of).optional()?)
}
