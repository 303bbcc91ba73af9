//! The one SQLite file of a data directory: jobs, events, files, checkpoints. Only the service opens it.
//!
//! One connection writes, under a lock; a few others read. Every change of a job is a compare-and-set on its `rev`
//! inside a transaction that also writes the event, so what a client saw and what the file says never differ.

mod adoption;
pub mod idempotency;
pub mod calibration;
mod deletion;
mod dependencies;
pub mod statistics;
pub mod events;
pub mod ids;
pub mod import;
pub mod integrity;
pub mod listing;
pub mod migrations;
pub mod points;
pub mod refinements;
pub mod retention;
pub mod rows;
pub mod finish_attempt;
pub mod service_clock;
pub mod studies;
mod study_limits;
pub mod submission;
mod group_commit;
mod sources;
pub mod transitions;
pub mod uploads;
mod waiting_jobs;
mod work_precision;

pub use events::Event;
pub use idempotency::{IdempotencyKey, Made, Receipt};
pub use listing::JobFilter;
pub use points::PointRow;
pub use refinements::{LevelRow, LevelSource, NewLevel, RefinementRow};
pub use rows::{CheckpointRow, FileRow, JobRow};
pub use studies::{NewStudy, StudyRow};
pub use submission::{NewJob, START_CHECKPOINT, scene_sha256};
pub use transitions::{Change, ChangeError};
pub use uploads::{NewUpload, UploadRow};

use crate::service::executor::Orphans;
use crate::spec::body::{JobSource, Origin, RestartSource, resolved_scene};
use crate::spec::states::State;
use ids::RisingIds;
use rusqlite::config::DbConfig;
use rusqlite::{Connection, OptionalExtension, Transaction, TransactionBehavior};
use service_clock::ServiceClock;
use std::path::{Path, PathBuf};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;
use tokio::sync::watch;
use ulid::Ulid;

/// Name of the file in the data directory.
pub const FILE_NAME: &str = "meniscus.sqlite";
/// Folder of the jobs in the data directory.
pub const JOBS: &str = "jobs";
/// Folder of the uploads in the data directory.
pub const UPLOADS: &str = "uploads";
/// Size from which on the log is trimmed while there are no writers.
const LONG_LOG_BYTES: u64 = 2 << 20;
/// Size from which on the log is trimmed even while there are writers.
const LONGEST_LOG_BYTES: u64 = 128 << 20;
/// Pages of the log at which a commit itself trims it.
const LONGEST_LOG_PAGES: i64 = 65_536;
/// Number of connections for reading.
const READERS: usize = 4;

/// The store of a data directory.
pub struct Store {
    directory: PathBuf,
    /// Folders of jobs and uploads, as every machine sees them: in the data directory they may be links to a shared one.
    jobs: PathBuf,
    uploads: PathBuf,
    /// Tells which attempts may still have a process that writes.
    orphans: OnceLock<Orphans>,
    writer: Arc<Mutex<Connection>>,
    /// Small transactions that wait for the writer.
    waiting: Mutex<Sender<group_commit::Waiting>>,
    readers: Vec<Mutex<Connection>>,
    next_reader: std::sync::atomic::AtomicUsize,
    /// Connection that trims the log.
    trimmer: Mutex<Connection>,
    ids: RisingIds,
    /// Seconds for which services have run on this directory.
    clock: ServiceClock,
    /// Counts changes; waiting clients watch it.
    changes: watch::Sender<u64>,
}

/// The store failed.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// SQLite reported an error.
    #[error("the store failed: {0}")]
    Sqlite(#[from] rusqlite::Error),
    /// The system failed.
    #[error("the data directory failed: {0}")]
    Io(#[from] std::io::Error),
    /// The checkpoint of a restart was removed in the meantime.
    #[error("the checkpoint is gone")]
    CheckpointGone,
    /// An upload that a scene names was removed in the meantime.
    #[error("the upload is gone")]
    UploadGone,
    /// A transaction that was shared with others failed.
    #[error("the store failed: {0}")]
    GroupCommit(String),
    /// A job could not be brought back from its files.
    #[error("a job could not be adopted: {0}")]
    Adoption(String),
    /// A stored value cannot be read.
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
        let folder = |name: &str| {
            let path = directory.join(name);
            std::fs::create_dir_all(&path)?;
            std::fs::canonicalize(path)
        };
        let (jobs, uploads) = (folder(JOBS)?, folder(UPLOADS)?);
        let path = directory.join(FILE_NAME);
        let mut writer = connect(&path)?;
        migrations::apply(&mut writer)?;
        let (ids, clock) = (RisingIds::above(&writer)?, ServiceClock::open(&writer)?);
        let (writer, changes) = (Arc::new(Mutex::new(writer)), watch::Sender::new(0));
        let readers = (0..READERS).map(|_| connect(&path).map(Mutex::new)).collect::<Result<_, _>>()?;
        Ok(Self {
            directory: directory.to_owned(),
            jobs,
            uploads,
            orphans: OnceLock::new(),
            waiting: group_commit::start(Arc::clone(&writer), changes.clone())?,
            writer,
            readers,
            next_reader: std::sync::atomic::AtomicUsize::new(0),
            trimmer: Mutex::new(connect(&path)?),
            ids,
            clock,
            changes,
        })
    }

    /// The directory of a job.
    #[must_use]
    pub fn job_directory(&self, job: &str) -> PathBuf {
        self.jobs.join(job)
    }

    /// The folder of all jobs, on whichever file system it lies.
    #[must_use]
    pub fn jobs_directory(&self) -> &Path {
        &self.jobs
    }

    /// The folder of uploads.
    pub(super) fn uploads_directory(&self) -> &Path {
        &self.uploads
    }

    /// Attempts run on a cluster: files of those of which a process may still write are deleted later. Only the first call counts.
    pub fn spare_orphans(&self, orphans: Orphans) {
        // There is one executor.
        let _ = self.orphans.set(orphans);
    }

    /// The data directory.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// A counter that rises with every committed change.
    #[must_use]
    pub fn watch(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    /// Whether attempts run on a cluster.
    fn is_on_cluster(&self) -> bool {
        self.orphans.get().is_some()
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

    fn next_id(&self) -> Ulid {
        self.ids.next()
    }

    /// An id and a reading of the clock that rise together.
    fn next_submission(&self) -> (Ulid, f64) {
        self.ids.next_with(|| self.clock.seconds())
    }

    /// Folds the log into the file and closes it. What comes later fails.
    pub fn close(&self) {
        if let Err(error) = self.save_clock() {
            tracing::warn!(%error, "the clock of the data directory could not be saved");
        }
        // The last connection that closes folds the log and removes it.
        for connection in [&self.trimmer].into_iter().chain(&self.readers).chain([&*self.writer]) {
            let mut connection = connection.lock().unwrap_or_else(PoisonError::into_inner);
            let Ok(nothing) = Connection::open_in_memory() else { continue };
            if let Err((_, error)) = std::mem::replace(&mut *connection, nothing).close() {
                tracing::warn!(%error, "a connection to the store could not be closed");
            }
        }
    }

    /// Whether the store can be written. A change that changes nothing is made durable.
    ///
    /// # Errors
    /// [`StoreError`] with what stands in the way.
    pub fn try_writing(&self) -> Result<(), StoreError> {
        let connection = self.writer.lock().unwrap_or_else(PoisonError::into_inner);
        connection.pragma_update(None, "user_version", migrations::known())?;
        Ok(())
    }

    /// Revision of a job and count of its progress: they differ between any two versions of it.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn version(&self, id: &str) -> Result<Option<(i64, i64)>, StoreError> {
        let connection = self.read();
        Ok(connection
            .prepare_cached("SELECT rev, progress_count FROM jobs WHERE id = ?1")?
            .query_row([id], |row| Ok((row.get(0)?, row.get(1)?)))
            .optional()?)
    }

    /// Moves the log into the store's file while there are no writers, whose commits would wait. Only a very long log is
    /// trimmed in any case.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn trim_log(&self, is_idle: bool) -> Result<(), StoreError> {
        let log = self.directory.join(format!("{FILE_NAME}-wal"));
        let least = if is_idle { LONG_LOG_BYTES } else { LONGEST_LOG_BYTES };
        if std::fs::metadata(log).is_ok_and(|meta| meta.len() > least) {
            let trimmer = self.trimmer.lock().unwrap_or_else(PoisonError::into_inner);
            trimmer.query_row("PRAGMA wal_checkpoint(PASSIVE)", [], |_| Ok(()))?;
        }
        Ok(())
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
        let Some(job) = rows::job(&connection, &row.job)? else { return Ok(None) };
        let (origin, scene) = (Origin::Checkpoint(row.id), resolved_scene(&job.resolved)?);
        Ok(Some(RestartSource { origin, scene, isa: row.isa, step: row.step }))
    }

    /// What a body that names a job needs to know of it; None where there is no such job.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn job_source(&self, id: &str) -> Result<Option<JobSource>, StoreError> {
        let Some(row) = self.job(id)? else { return Ok(None) };
        let newest = self.checkpoints(id)?.into_iter().next();
        let checkpoint = newest.map(|newest| self.restart_source(&newest.id)).transpose()?.flatten();
        Ok(Some(JobSource { state: row.state, scene: resolved_scene(&row.resolved)?, checkpoint }))
    }

    /// Deletes a job in a terminal state and its files; false where it is in another state.
    ///
    /// The row goes first, so that a row without files never exists. Files that the system does not let go are deleted later.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn delete(&self, id: &str) -> Result<bool, StoreError> {
        let folder = job_folder(id);
        let deleted = self.write(|transaction| -> Result<bool, StoreError> {
            let state: Option<String> =
                transaction.query_row("SELECT state FROM jobs WHERE id = ?1", [id], |row| row.get(0)).optional()?;
            if !state.as_deref().and_then(State::from_word).is_some_and(State::is_terminal) {
                return Ok(false);
            }
            delete_rows(transaction, id)?;
            deletion::intend(transaction, &folder)?;
            Ok(true)
        })?;
        if deleted {
            self.delete_folder(&folder)?;
        }
        Ok(deleted)
    }
}

/// Folder of a job below the data directory.
fn job_folder(job: &str) -> String {
    format!("{JOBS}/{job}")
}

fn delete_rows(transaction: &Transaction, job: &str) -> rusqlite::Result<()> {
    // The point of a study that it repeated is again what it was before.
    transaction
        .prepare_cached(
            "UPDATE jobs SET superseded = 0 WHERE id = (SELECT retry_of FROM jobs WHERE id = ?1 AND superseded = 0)",
        )?
        .execute([job])?;
    for table in ["events", "files", "checkpoints", "inputs", "dependencies"] {
        transaction.prepare_cached(&format!("DELETE FROM {table} WHERE job = ?1"))?.execute([job])?;
    }
    transaction.prepare_cached("DELETE FROM jobs WHERE id = ?1")?.execute([job]).map(|_| ())
}

pub(crate) fn connect(path: &Path) -> Result<Connection, rusqlite::Error> {
    let connection = Connection::open(path)?;
    connection.busy_timeout(Duration::from_secs(10))?;
    connection.pragma_update(None, "journal_mode", "WAL")?;
    connection.pragma_update(None, "synchronous", "FULL")?;
    connection.pragma_update(None, "foreign_keys", "ON")?;
    connection.pragma_update(None, "wal_autocheckpoint", LONGEST_LOG_PAGES)?;
    // A plan does not depend on the values that are asked for: else statements are prepared anew for every one.
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_QPSG, true)?;
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
