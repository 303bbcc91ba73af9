//! Adoption: jobs and uploads come back from their own files into a database that does not know them, or not all of their
//! attempts. The records of an attempt are taken as they are from a running worker.

use super::finish_attempt::{LossCause, LossKind};
use super::import::ProgressPace;
use super::submission::{self, NewJob};
use super::transitions::apply;
use super::uploads::UploadRecord;
use super::{Change, ChangeError, Store, StoreError};
use crate::spec::attempt_files::attempt_directory;
use crate::spec::attempt_spec::AttemptSpec;
use crate::spec::records::{self, Verdict};
use crate::spec::states::{Reason, State, Trigger};
use rusqlite::{OptionalExtension, params};
use std::collections::HashMap;

impl Store {
    /// Enters a job that the database does not know, as it was submitted.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn adopt_job(&self, spec: &AttemptSpec) -> Result<(), StoreError> {
        let submitted = spec.submission.clone().unwrap_or_default();
        let mut job = NewJob::from_attempt(spec)?;
        let start = spec.checkpoints.iter().find(|checkpoint| !checkpoint.is_own);
        if let Some((_, number)) = spec.job.split_once('_')
            && let Ok(number) = number.parse()
        {
            self.ids.rise_above(number);
        }
        let clock_s = self.clock.seconds();
        self.write(|transaction| -> Result<(), StoreError> {
            let knows = |table: &str, id: &str| -> rusqlite::Result<bool> {
                let sql = format!("SELECT EXISTS (SELECT 1 FROM {table} WHERE id = ?1)");
                transaction.prepare_cached(&sql)?.query_row([id], |row| row.get(0))
            };
            if let Some((study, _)) = &job.study
                && !knows("studies", study)?
            {
                tracing::warn!(job = spec.job, study, "the study of an adopted job is lost; the job stands alone");
                job.study = None;
            }
            let lost: Vec<String> =
                job.uploads.iter().filter(|id| !knows("uploads", id).unwrap_or(false)).cloned().collect();
            if !lost.is_empty() {
                tracing::warn!(job = spec.job, uploads = lost.join(", "), "uploads of an adopted job are lost; if it needs them it fails");
            }
            job.uploads.retain(|id| !lost.contains(id));
            let place = submission::Place { id: &spec.job, clock_s };
            submission::insert(transaction, &place, &job, start.and_then(|start| start.sha256.as_deref()))?;
            transaction.execute(
                "UPDATE jobs SET restarted_from = ?2, created_at = COALESCE(?3, created_at), started_at = ?4 WHERE id = ?1",
                params![spec.job, start.map(|start| &start.id), submitted.created_at, submitted.started_at],
            )?;
            Ok(())
        })
    }

    /// Takes the records of all attempts from `first` to `last`, as if their workers had just ended.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn replay_attempts(&self, job: &str, first: u64, last: u64) -> Result<(), StoreError> {
        for attempt in first..=last {
            let Some(state) = self.state(job)? else { return Ok(()) };
            if state.is_terminal() {
                tracing::warn!(job, attempt, "an attempt behind the end of its job is left out");
                return Ok(());
            }
            if !state.has_worker() {
                self.begin_replay(job, attempt)?;
            }
            self.replay(job, attempt)?;
        }
        self.drop_missing_files(job)?;
        self.set_end(job, last)
    }

    /// Brings a waiting job to the attempt whose records are to be taken.
    fn begin_replay(&self, job: &str, attempt: u64) -> Result<(), StoreError> {
        let begun: Result<(), ChangeError> = self.write(|transaction| {
            let paused: bool =
                transaction.query_row("SELECT state = 'paused' FROM jobs WHERE id = ?1", [job], |row| row.get(0))?;
            if paused {
                apply(transaction, job, Trigger::Resume, &Change::default())?;
            }
            transaction.execute("UPDATE jobs SET attempt = ?2 WHERE id = ?1", params![job, attempt as i64 - 1])?;
            apply(transaction, job, Trigger::Claim, &Change::default())
        });
        begun.map_err(refused)
    }

    fn replay(&self, job: &str, attempt: u64) -> Result<(), StoreError> {
        let imported = self.import(job, attempt, &mut ProgressPace::default())?;
        if imported.verdict == Some(Verdict::Canceled)
            && let Err(ChangeError::Store(error)) =
                self.change(job, Trigger::Cancel, &Change::because(Reason::UserCancel))
        {
            // Other errors say that it was canceled before.
            return Err(error);
        }
        self.finish_attempt(job, attempt, &LossCause::new(Reason::ServerRestart, LossKind::Harmless))
    }

    /// Takes checkpoints and files out of the database that are not there any more: records tell of all that were written.
    fn drop_missing_files(&self, job: &str) -> Result<(), StoreError> {
        let directory = self.job_directory(job);
        let is_missing = |attempt: u64, path: &str| !attempt_directory(&directory, attempt).join(path).is_file();
        let checkpoints: Vec<String> = self
            .checkpoints(job)?
            .into_iter()
            .filter(|row| is_missing(row.attempt, &row.path))
            .map(|row| row.id)
            .collect();
        let files = self.files(job)?.into_iter().filter(|file| file.content.is_none());
        let files: Vec<String> =
            files.filter(|file| is_missing(file.attempt, &file.path)).map(|file| file.path).collect();
        self.write(|transaction| {
            for id in &checkpoints {
                transaction.execute("DELETE FROM checkpoints WHERE id = ?1", [id])?;
            }
            for path in &files {
                transaction.execute("DELETE FROM files WHERE job = ?1 AND path = ?2", params![job, path])?;
            }
            Ok(())
        })
    }

    /// End of an adopted job, as its records tell.
    fn set_end(&self, job: &str, last: u64) -> Result<(), StoreError> {
        let lines = records::read_from(&attempt_directory(&self.job_directory(job), last), 0)?;
        let end = lines.into_iter().rev().find_map(|(line, _)| Some(line?.at));
        if !self.state(job)?.is_some_and(State::is_terminal) {
            return Ok(());
        }
        self.write(|transaction| {
            transaction
                .execute("UPDATE jobs SET finished_at = COALESCE(?2, finished_at) WHERE id = ?1", params![job, end])?;
            Ok(())
        })
    }

    /// Enters an upload that the database does not know.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn adopt_upload(&self, record: &UploadRecord) -> Result<(), StoreError> {
        let found = record.found.as_ref().map(serde_json::to_string).transpose()?;
        let state = if found.is_some() { "ready" } else { "rejected" };
        self.write(|transaction| {
            transaction.execute(
                "INSERT OR IGNORE INTO uploads (id, purpose, state, reason, found, name, size_bytes, sha256, created_at,
                     checked_at, owner)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?9, ?10)",
                params![
                    record.id,
                    record.purpose.word(),
                    state,
                    record.reason,
                    found,
                    record.name,
                    record.size_bytes as i64,
                    record.sha256,
                    record.created_at,
                    record.owner,
                ],
            )?;
            Ok(())
        })
    }

    /// The latest attempt of every job.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn attempts(&self) -> Result<HashMap<String, u64>, StoreError> {
        let connection = self.read();
        let mut statement = connection.prepare_cached("SELECT id, attempt FROM jobs")?;
        let rows = statement.query_map([], |row| Ok((row.get(0)?, row.get::<_, i64>(1)? as u64)))?;
        Ok(rows.collect::<Result<_, _>>()?)
    }

    /// Whether the database knows an upload or a job by its id.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn knows(&self, id: &str) -> Result<bool, StoreError> {
        let table = if id.starts_with("upl_") { "uploads" } else { "jobs" };
        let connection = self.read();
        let found: Option<i64> = connection
            .prepare_cached(&format!("SELECT 1 FROM {table} WHERE id = ?1"))?
            .query_row([id], |row| row.get(0))
            .optional()?;
        Ok(found.is_some())
    }
}

/// A transition that the table refuses while nothing else runs means that the row is damaged.
fn refused(error: ChangeError) -> StoreError {
    match error {
        ChangeError::Store(error) => error,
        other => StoreError::Adoption(other.to_string()),
    }
}
