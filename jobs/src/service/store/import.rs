//! Publishing a worker's records: each is taken exactly once, together with the offset behind it, and only while the
//! job is at the record's attempt.

use super::{Store, StoreError, calibration, events, rows, work_precision};
use crate::spec::attempt_files::{self, attempt_directory};
use crate::spec::forecast::measured;
use crate::spec::health::{Finding, FindingLog, HealthStatus, Severity};
use crate::spec::records::{self, CheckpointRecord, FileRecord, Line, Progress, Record, Usage, Verdict};
use crate::spec::report::{Results, RunReport};
use crate::spec::run_options::RunOptions;
use crate::spec::work_precision::of_report;
use rusqlite::{OptionalExtension, Transaction, params};
use serde_json::json;
use std::borrow::Cow;
use std::time::{Duration, Instant};

/// Least time between two progress events of a job.
const PROGRESS_EVENT_INTERVAL: Duration = Duration::from_secs(1);

/// When the last progress event of a running job was written.
#[derive(Debug, Default)]
pub struct ProgressPace {
    last: Option<Instant>,
}

/// Outcome of an import.
#[derive(Debug)]
pub struct Imported {
    /// Whether every whole record that the worker has written is taken.
    pub is_whole: bool,
    /// The worker's verdict, if it came.
    pub verdict: Option<Verdict>,
    /// Whether a checkpoint was among them.
    pub has_checkpoint: bool,
    /// Whether there were new records.
    pub any: bool,
}

impl Default for Imported {
    fn default() -> Self {
        Self { is_whole: true, verdict: None, has_checkpoint: false, any: false }
    }
}

impl Store {
    /// Takes the new records of an attempt.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn import(&self, job: &str, epoch: u64, pace: &mut ProgressPace) -> Result<Imported, StoreError> {
        let Some(row) = self.job(job)?.filter(|row| row.attempt == epoch) else {
            return Ok(Imported::default());
        };
        let directory = attempt_directory(&self.job_directory(job), epoch);
        let lines = records::read_from(&directory, row.records_offset)?;
        let Some((_, end)) = lines.last() else {
            return Ok(Imported::default());
        };
        let end = *end;
        let mut imported = Imported { any: true, ..Imported::default() };
        let of = Attempt { job, study: row.study.as_deref(), epoch };
        self.write(|transaction| -> Result<(), StoreError> {
            // The epoch and the offset are checked again inside the transaction: this is the fence.
            let changed = transaction
                .prepare_cached(
                    "UPDATE jobs SET records_offset = ?4 WHERE id = ?1 AND attempt = ?2 AND records_offset = ?3",
                )?
                .execute(params![job, epoch as i64, row.records_offset as i64, end as i64])?;
            if changed != 1 {
                return Ok(());
            }
            let mut latest: Option<Progress> = None;
            for (line, _) in lines {
                let Some(Line { epoch: stamped, record, .. }) = line else { continue };
                if stamped != epoch {
                    continue;
                }
                match record {
                    Record::Progress(progress) => latest = Some(progress),
                    Record::Verdict(verdict) => {
                        // Kept with the offset, so that no crash can separate the two.
                        let text = serde_json::to_string(&verdict)?;
                        transaction.execute("UPDATE jobs SET verdict = ?2 WHERE id = ?1", params![job, text])?;
                        imported.verdict = Some(verdict);
                    }
                    Record::Checkpoint(checkpoint) => {
                        imported.has_checkpoint = true;
                        take_checkpoint(transaction, &of, &checkpoint)?;
                    }
                    other => self.take(transaction, &of, &other)?,
                }
            }
            if let Some(progress) = latest {
                let due = pace.last.is_none_or(|last| last.elapsed() >= PROGRESS_EVENT_INTERVAL);
                take_progress(transaction, &of, &progress, due || imported.verdict.is_some())?;
                if due {
                    pace.last = Some(Instant::now());
                }
            } else if imported.verdict.is_some() {
                flush_progress(transaction, &of)?;
            }
            Ok(())
        })?;
        Ok(imported)
    }

    /// Books what the service knows of an attempt's cost. What is on the disk already is not needed once more.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn book_usage(&self, job: &str, epoch: u64, usage: &Usage) -> Result<(), StoreError> {
        let text = serde_json::to_string(usage)?;
        self.write(|transaction| {
            transaction
                .prepare_cached(
                    "UPDATE jobs SET usage = ?3, progress_count = progress_count + 1,
                         disk_bytes = MAX(0, CAST(json_extract(estimate, '$.disk_bytes') AS INTEGER) - ?4)
                     WHERE id = ?1 AND attempt = ?2",
                )?
                .execute(params![job, epoch as i64, text, usage.disk_bytes as i64])?;
            Ok(())
        })
    }

    /// Takes one checkpoint out of the store and removes its file; false while a restart from it has not ended.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn delete_checkpoint(&self, row: &super::CheckpointRow) -> Result<bool, StoreError> {
        let deleted = self.write(|transaction| -> Result<bool, StoreError> {
            let users: i64 = transaction.query_row(
                "SELECT COUNT(*) FROM jobs WHERE restarted_from = ?1 AND state NOT IN ('succeeded', 'failed', 'canceled')",
                [&row.id],
                |row| row.get(0),
            )?;
            if users > 0 {
                return Ok(false);
            }
            transaction.execute("DELETE FROM checkpoints WHERE id = ?1", [&row.id])?;
            Ok(true)
        })?;
        if !deleted {
            return Ok(false);
        }
        let directory = attempt_directory(&self.job_directory(&row.job), row.attempt);
        if let Err(error) = std::fs::remove_file(directory.join(&row.path)) {
            tracing::warn!(job = row.job, checkpoint = row.id, %error, "the file of a deleted checkpoint is left");
        }
        Ok(true)
    }

    /// Takes checkpoints beyond the newest `keep` out of the store; the caller removes their files.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn prune_checkpoints(&self, job: &str, keep: usize) -> Result<Vec<super::CheckpointRow>, StoreError> {
        let old: Vec<_> = self.checkpoints(job)?.into_iter().skip(keep.max(2)).collect();
        if old.is_empty() {
            return Ok(old);
        }
        self.write(|transaction| -> Result<(), StoreError> {
            for checkpoint in &old {
                transaction.execute("DELETE FROM checkpoints WHERE id = ?1", [&checkpoint.id])?;
            }
            Ok(())
        })?;
        Ok(old)
    }
}

/// The attempt whose records are taken.
struct Attempt<'a> {
    job: &'a str,
    study: Option<&'a str>,
    epoch: u64,
}

impl Attempt<'_> {
    fn append_event(&self, transaction: &Transaction, kind: &str, data: &serde_json::Value) -> Result<(), StoreError> {
        Ok(events::append(transaction, self.job, self.study, self.epoch, kind, data)?)
    }
}

impl Store {
    /// Keeps the errors and the cost of a finished run in its row, so that tables of thousands open no file.
    fn keep_results(&self, transaction: &Transaction, of: &Attempt) -> Result<(), StoreError> {
        let directory = attempt_directory(&self.job_directory(of.job), of.epoch);
        let report: RunReport = serde_json::from_slice(&std::fs::read(directory.join(attempt_files::REPORT))?)?;
        // Runs that began in the middle or were cut off tell nothing about whole ones.
        if let Some(row) =
            rows::job(transaction, of.job)?.filter(|row| row.attempt == 1 && row.restarted_from.is_none())
        {
            let threads = RunOptions::from_resolved(&row.resolved)?.limits.threads;
            calibration::add(
                transaction,
                &self.machine_of(report.provenance.cpu.as_deref().unwrap_or("unknown")),
                &measured(&row.forecast, &report.cost, threads),
            )?;
            if let Some((problem, spacing)) = problem_of(transaction, of.job)? {
                work_precision::keep(transaction, &of_report(&problem, spacing, &report))?;
            }
        }
        let RunReport { errors, cost, .. } = report;
        transaction.execute(
            "UPDATE jobs SET results = ?2 WHERE id = ?1",
            params![of.job, serde_json::to_string(&Results { errors, cost })?],
        )?;
        Ok(())
    }

    fn take(&self, transaction: &Transaction, of: &Attempt, record: &Record) -> Result<(), StoreError> {
        let job = of.job;
        match record {
            Record::Started { frames, step, from_checkpoint, .. } => {
                take_start(transaction, job, *frames, *step)?;
                // Findings of steps that are to come again are void, too.
                change_findings(transaction, job, |log| {
                    if *from_checkpoint { log.truncate(*step) } else { *log = FindingLog::default() }
                })?;
            }
            Record::File(file) => {
                take_file(transaction, of, file)?;
                if file.path == attempt_files::REPORT {
                    self.keep_results(transaction, of)?;
                }
            }
            Record::Warning { code, message } => {
                let Some(row) = rows::job(transaction, job)? else { return Ok(()) };
                let (step, time) = (row.progress.step, row.progress.time);
                let mut warnings = row.warnings;
                warnings.push(Finding {
                    code: Cow::Owned(code.clone()),
                    ..Finding::warning("", message.clone(), (step, time))
                });
                transaction.execute(
                    "UPDATE jobs SET warnings = ?2, progress_count = progress_count + 1 WHERE id = ?1",
                    params![job, serde_json::to_string(&warnings)?],
                )?;
                of.append_event(transaction, "warning", &json!({"code": code, "message": message}))?;
            }
            Record::Finding(finding) => {
                change_findings(transaction, job, |log| log.push(finding.clone()))?;
                if finding.severity == Severity::Warning {
                    let doubtful = HealthStatus::Doubtful.word();
                    transaction.execute("UPDATE jobs SET health = ?2 WHERE id = ?1", params![job, doubtful])?;
                }
                of.append_event(transaction, "finding", &serde_json::to_value(finding)?)?;
            }
            Record::Phase { phase } => {
                let Some(row) = rows::job(transaction, job)? else { return Ok(()) };
                let progress = Progress { phase: phase.clone(), ..row.progress };
                transaction.execute(
                    "UPDATE jobs SET progress = ?2, progress_count = progress_count + 1 WHERE id = ?1",
                    params![job, serde_json::to_string(&progress)?],
                )?;
            }
            Record::Progress(_) | Record::Checkpoint(_) | Record::Verdict(_) => {}
        }
        Ok(())
    }
}

/// Problem and spacing of a job, where they are known.
fn problem_of(transaction: &Transaction, job: &str) -> rusqlite::Result<Option<(String, f64)>> {
    let (problem, spacing): (Option<String>, Option<f64>) =
        transaction.query_row("SELECT problem, spacing FROM jobs WHERE id = ?1", [job], |row| {
            Ok((row.get(0)?, row.get(1)?))
        })?;
    Ok(problem.zip(spacing))
}

/// Changes the findings that a job keeps.
fn change_findings(
    transaction: &Transaction,
    job: &str,
    change: impl FnOnce(&mut FindingLog),
) -> Result<(), StoreError> {
    let text: String =
        transaction.query_row("SELECT findings FROM jobs WHERE id = ?1", [job], |row| row.get("findings"))?;
    let mut log = FindingLog::new(serde_json::from_str(&text)?);
    change(&mut log);
    transaction.execute(
        "UPDATE jobs SET findings = ?2, progress_count = progress_count + 1 WHERE id = ?1",
        params![job, serde_json::to_string(log.findings())?],
    )?;
    Ok(())
}

/// Takes the start of an attempt from a checkpoint: what was published after the checkpoint is void until it comes again.
fn take_start(transaction: &Transaction, job: &str, frames: u64, step: u64) -> Result<(), StoreError> {
    let paths: Vec<String> = {
        let mut statement = transaction
            .prepare_cached("SELECT path FROM files WHERE job = ?1 AND path LIKE 'frames/%' ORDER BY path")?;
        let rows = statement.query_map([job], |row| row.get(0))?;
        rows.collect::<Result<_, _>>()?
    };
    for path in paths.iter().skip(frames as usize) {
        transaction.execute("DELETE FROM files WHERE job = ?1 AND path = ?2", params![job, path])?;
    }
    // The worker refused the checkpoints of steps that are to come again.
    transaction.execute("DELETE FROM checkpoints WHERE job = ?1 AND step > ?2", params![job, step as i64])?;
    Ok(())
}

fn take_file(transaction: &Transaction, of: &Attempt, file: &FileRecord) -> Result<(), StoreError> {
    transaction
        .prepare_cached(
            "INSERT OR REPLACE INTO files (job, path, attempt, size_bytes, sha256, media_type, time, step)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
        )?
        .execute(params![
            of.job,
            file.path,
            of.epoch as i64,
            file.size_bytes as i64,
            file.sha256,
            file.media_type,
            file.time,
            file.step.map(|step| step as i64),
        ])?;
    if file.step.is_some() {
        let data = json!({"path": file.path, "time": file.time, "step": file.step, "size_bytes": file.size_bytes});
        of.append_event(transaction, "frame", &data)?;
    }
    Ok(())
}

fn take_checkpoint(transaction: &Transaction, of: &Attempt, checkpoint: &CheckpointRecord) -> Result<(), StoreError> {
    let Attempt { job, epoch, .. } = *of;
    transaction
        .prepare_cached(
            "INSERT OR REPLACE INTO checkpoints (id, job, attempt, path, step, time, size_bytes, sha256, created_at, isa, build)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)",
        )?
        .execute(params![
            checkpoint.id,
            job,
            epoch as i64,
            checkpoint.path,
            checkpoint.step as i64,
            checkpoint.time,
            checkpoint.size_bytes as i64,
            checkpoint.sha256,
            crate::system::clock::now(),
            checkpoint.isa,
            checkpoint.build,
        ])?;
    transaction.execute("UPDATE jobs SET checkpoint_since = 1 WHERE id = ?1", [job])?;
    let data = json!({"id": checkpoint.id, "step": checkpoint.step, "time": checkpoint.time, "size_bytes": checkpoint.size_bytes});
    of.append_event(transaction, "checkpoint", &data)
}

/// The last progress as an event, if the coalescing held it back: the end of a run is never missing.
fn flush_progress(transaction: &Transaction, of: &Attempt) -> Result<(), StoreError> {
    let job = of.job;
    let Some(row) = rows::job(transaction, job)? else { return Ok(()) };
    let last_step: Option<u64> = transaction
        .query_row(
            "SELECT json_extract(data, '$.step') FROM events WHERE job = ?1 AND type = 'progress' ORDER BY id DESC LIMIT 1",
            [job],
            |row| row.get::<_, Option<i64>>(0),
        )
        .optional()?
        .flatten()
        .map(|step| step as u64);
    if row.progress_count > 0 && last_step != Some(row.progress.step) {
        append_progress(transaction, of, &row.progress)?;
    }
    Ok(())
}

fn append_progress(transaction: &Transaction, of: &Attempt, progress: &Progress) -> Result<(), StoreError> {
    let data = json!({
        "fraction": progress.fraction, "time": progress.time, "step": progress.step,
        "steps_per_s": progress.steps_per_s, "eta_s": progress.eta_s,
    });
    of.append_event(transaction, "progress", &data)
}

fn take_progress(
    transaction: &Transaction,
    of: &Attempt,
    progress: &Progress,
    is_event: bool,
) -> Result<(), StoreError> {
    let job = of.job;
    let before = rows::job(transaction, job)?.map(|row| row.progress.fraction).unwrap_or_default();
    // The fraction never falls, also where an attempt repeats what a lost one had done.
    let mut shown = progress.clone();
    shown.fraction = shown.fraction.max(before);
    transaction
        .prepare_cached(
            "UPDATE jobs SET progress = ?2, usage = ?3, health = ?4, progress_count = progress_count + 1 WHERE id = ?1",
        )?
        .execute(params![
            job,
            serde_json::to_string(&shown)?,
            serde_json::to_string(&progress.usage)?,
            progress.health.status.map(HealthStatus::word),
        ])?;
    if is_event {
        append_progress(transaction, of, &shown)?;
    }
    Ok(())
}
