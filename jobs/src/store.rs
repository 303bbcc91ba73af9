//! The one SQLite file of a data directory: jobs, events, files, checkpoints. Only the service opens it.
//!
//! One connection writes, under a lock; a few others read. Every change of a job is a compare-and-set on its `rev`
//! inside a transaction that also writes the event, so what a client saw and what the file says never differ.

pub mod events;
pub mod import;
pub mod listing;
pub mod migrations;
pub mod rows;
pub mod settle;
pub mod transitions;

pub use events::Event;
pub use listing::JobFilter;
pub use rows::{CheckpointRow, FileRow, JobRow};
pub use transitions::{Change, ChangeError};

use crate::body::{JobBody, RestartSource};
use crate::job::State;
use rusqlite::{Connection, OptionalExtension, Transaction, TransactionBehavior, params};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::watch;
use ulid::Ulid;

/// Name of the file in the data directory.
pub const FILE_NAME: &str = "meniscus.sqlite";
/// Connections for reading.
const READERS: usize = 4;

/// The store of a data directory.
pub struct Store {
    directory: PathBuf,
    writer: Mutex<Connection>,
    readers: Vec<Mutex<Connection>>,
    next_reader: std::sync::atomic::AtomicUsize,
    /// Ids that rise even within a millisecond.
    ids: Mutex<ulid::Generator>,
    /// Counts changes; waiting clients watch it.
    changes: watch::Sender<u64>,
}

/// The store failed.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// SQLite failed.
    #[error("the store failed: {0}")]
    Sqlite(#[from] rusqlite::Error),
    /// The system failed.
    #[error("the data directory failed: {0}")]
    Io(#[from] std::io::Error),
    /// The checkpoint of a restart was removed in the meantime.
    #[error("the checkpoint is gone")]
    CheckpointGone,
    /// A row does not say what it should.
    #[error("a stored value is unreadable: {0}")]
    Json(#[from] serde_json::Error),
    /// The file was written by a later version of the program.
    #[error("the store has schema {found}, this program knows {known}")]
    Newer {
        /// Of the file.
        found: i64,
        /// Of the program.
        known: i64,
    },
}

impl Store {
    /// Opens or makes the store of a data directory and brings its schema up to date.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn open(directory: &Path) -> Result<Self, StoreError> {
        std::fs::create_dir_all(directory.join("jobs"))?;
        let path = directory.join(FILE_NAME);
        let mut writer = connect(&path)?;
        migrations::apply(&mut writer)?;
        let readers = (0..READERS).map(|_| connect(&path).map(Mutex::new)).collect::<Result<_, _>>()?;
        Ok(Self {
            directory: directory.to_owned(),
            writer: Mutex::new(writer),
            readers,
            next_reader: std::sync::atomic::AtomicUsize::new(0),
            ids: Mutex::new(ulid::Generator::new()),
            changes: watch::Sender::new(0),
        })
    }

    /// The directory of a job.
    #[must_use]
    pub fn job_directory(&self, job: &str) -> PathBuf {
        self.directory.join("jobs").join(job)
    }

    /// The data directory.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Tells of every committed change.
    #[must_use]
    pub fn watch(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    pub(crate) fn read(&self) -> MutexGuard<'_, Connection> {
        let turn = self.next_reader.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        for k in 0..READERS {
            if let Ok(free) = self.readers[(turn + k) % READERS].try_lock() {
                return free;
            }
        }
        self.readers[turn % READERS].lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Runs work in one write transaction; it is durable when this returns.
    pub(crate) fn write<R, E: From<StoreError> + From<rusqlite::Error>>(
        &self,
        work: impl FnOnce(&Transaction) -> Result<R, E>,
    ) -> Result<R, E> {
        let mut connection = self.writer.lock().unwrap_or_else(PoisonError::into_inner);
        let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
        let result = work(&transaction)?;
        transaction.commit()?;
        drop(connection);
        self.changes.send_modify(|count| *count += 1);
        Ok(result)
    }

    /// Makes a job; it is durable when this returns. A restart's checkpoint is linked into the job's directory first,
    /// so that deleting the source takes nothing away.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn submit(&self, body: &JobBody) -> Result<JobRow, StoreError> {
        let id = format!("job_{}", self.next_id());
        let mut restart_sha256 = None;
        if let Some(checkpoint) = &body.restarted_from {
            let row = self.checkpoint(checkpoint)?.ok_or(StoreError::CheckpointGone)?;
            let folder = self.job_directory(&id);
            std::fs::create_dir_all(&folder)?;
            let source = crate::order::attempt_directory(&self.job_directory(&row.job), row.attempt).join(&row.path);
            let target = folder.join(START_CHECKPOINT);
            // Its row may have been there a moment ago and its file be gone by now.
            if std::fs::hard_link(&source, &target).is_err() && std::fs::copy(&source, &target).is_err() {
                remove_directory(&folder)?;
                return Err(StoreError::CheckpointGone);
            }
            crate::artifacts::sync_directory(&folder)?;
            restart_sha256 = Some(row.sha256);
        }
        let now = crate::clock::now();
        self.write(|transaction| {
            let estimate = json!({
                "particles": body.estimate.particles, "steps": body.estimate.steps,
                "time_step": body.estimate.time_step, "memory_bytes": crate::body::WORKER_BASE_BYTES.saturating_add(body.estimate.memory_bytes),
                "disk_bytes": body.disk_bytes,
            });
            transaction
                .prepare_cached(
                    "INSERT INTO jobs (id, rev, state, name, labels, kind, spec, resolved, estimate, priority, created_at, restarted_from, restart_sha256)
                     VALUES (?1, 1, 'queued', ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)",
                )?
                .execute(params![
                    id,
                    body.name,
                    serde_json::to_string(&body.labels)?,
                    body.kind,
                    body.spec.to_string(),
                    body.resolved.to_string(),
                    estimate.to_string(),
                    body.priority,
                    now,
                    body.restarted_from,
                    restart_sha256,
                ])?;
            events::append(transaction, &id, 0, "state", &json!({"from": Value::Null, "to": State::Queued.word()}))?;
            rows::job(transaction, &id)?.ok_or_else(|| rusqlite::Error::QueryReturnedNoRows.into())
        })
    }

    fn next_id(&self) -> Ulid {
        let mut generator = self.ids.lock().unwrap_or_else(PoisonError::into_inner);
        generator.generate().unwrap_or_else(|_| Ulid::generate())
    }

    /// A job by id.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn job(&self, id: &str) -> Result<Option<JobRow>, StoreError> {
        rows::job(&self.read(), id)
    }

    /// A checkpoint by id.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn checkpoint(&self, id: &str) -> Result<Option<CheckpointRow>, StoreError> {
        rows::checkpoint(&self.read(), id)
    }

    /// A job's checkpoints, newest first.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn checkpoints(&self, job: &str) -> Result<Vec<CheckpointRow>, StoreError> {
        rows::checkpoints(&self.read(), job)
    }

    /// A job's published files in the order of their paths.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn files(&self, job: &str) -> Result<Vec<FileRow>, StoreError> {
        rows::files(&self.read(), job)
    }

    /// A published file of a job.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn file(&self, job: &str, path: &str) -> Result<Option<FileRow>, StoreError> {
        rows::file(&self.read(), job, path)
    }

    /// What a restart from a checkpoint needs to know; None where there is no such checkpoint.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn restart_source(&self, checkpoint: &str) -> Result<Option<RestartSource>, StoreError> {
        let connection = self.read();
        let Some(row) = rows::checkpoint(&connection, checkpoint)? else {
            return Ok(None);
        };
        let job = rows::job(&connection, &row.job)?;
        Ok(job.map(|job| RestartSource {
            checkpoint: row.id,
            resolved: job.resolved,
            job: row.job,
            isa: row.isa,
            step: row.step,
        }))
    }

    /// Deletes a job in a terminal state and its files; false where it is in another state.
    ///
    /// The row goes first: files without a row are swept up at the next start, a row without files never exists.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn delete(&self, id: &str) -> Result<bool, StoreError> {
        let deleted = self.write(|transaction| -> Result<bool, StoreError> {
            let state: Option<String> =
                transaction.query_row("SELECT state FROM jobs WHERE id = ?1", [id], |row| row.get(0)).optional()?;
            if !state.as_deref().and_then(State::from_word).is_some_and(State::is_terminal) {
                return Ok(false);
            }
            for table in ["events", "files", "checkpoints"] {
                transaction.execute(&format!("DELETE FROM {table} WHERE job = ?1"), [id])?;
            }
            transaction.execute("DELETE FROM jobs WHERE id = ?1", [id])?;
            Ok(true)
        })?;
        if deleted {
            remove_directory(&self.job_directory(id))?;
        }
        Ok(deleted)
    }

    /// Removes directories of jobs that the store does not know: leftovers of a deletion or of a submission that a
    /// crash cut short.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn sweep(&self) -> Result<(), StoreError> {
        for entry in std::fs::read_dir(self.directory.join("jobs"))? {
            let entry = entry?;
            let name = entry.file_name();
            let known = match name.to_str() {
                Some(id) => self.job(id)?.is_some(),
                None => false,
            };
            if !known {
                remove_directory(&entry.path())?;
            }
        }
        Ok(())
    }
}

/// Name of a restart's checkpoint in the new job's directory.
pub const START_CHECKPOINT: &str = "start.h5";

pub(crate) fn connect(path: &Path) -> Result<Connection, rusqlite::Error> {
    let connection = Connection::open(path)?;
    connection.busy_timeout(Duration::from_secs(10))?;
    connection.pragma_update(None, "journal_mode", "WAL")?;
    connection.pragma_update(None, "synchronous", "FULL")?;
    connection.pragma_update(None, "foreign_keys", "ON")?;
    connection.set_prepared_statement_cache_capacity(64);
    Ok(connection)
}

fn remove_directory(path: &Path) -> std::io::Result<()> {
    match std::fs::remove_dir_all(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
