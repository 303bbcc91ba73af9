//! A consistent copy of a live data directory.
//!
//! The store is copied as one snapshot. Files that it lists never change under their names, so they can be copied
//! after it; what a running service removes in between (an old checkpoint, a deleted job) makes the copy start over.

use crate::service::data_directory::{DataDirectory, DataDirectoryError};
use crate::service::store::uploads::CONTENT;
use crate::service::store::{self, START_CHECKPOINT, Store, StoreError};
use crate::spec::attempt_files::attempt_directory;
use crate::system::artifacts;
use rusqlite::{Connection, OpenFlags};
use std::fs;
use std::io;
use std::path::Path;

/// Copies before giving up on a directory that never holds still.
const TRIES: usize = 5;

/// Why no backup was made.
#[derive(Debug, thiserror::Error)]
pub enum BackupError {
    /// The target has something in it.
    #[error("the target directory is not empty")]
    NotEmpty,
    /// There is no store to copy.
    #[error("there is no data directory to copy")]
    NoStore,
    /// Files went away during every try.
    #[error("the data directory changed during {TRIES} copies")]
    Restless,
    /// The copy could not be marked.
    #[error(transparent)]
    Directory(#[from] DataDirectoryError),
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The system failed.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// Copies `data` into the new or empty directory `target`; a service may be running on `data`.
///
/// # Errors
/// [`BackupError`].
pub fn back_up(data: &Path, target: &Path) -> Result<(), BackupError> {
    let file = data.join(store::FILE_NAME);
    if !file.is_file() {
        return Err(BackupError::NoStore);
    }
    fs::create_dir_all(target)?;
    if fs::read_dir(target)?.next().is_some() {
        return Err(BackupError::NotEmpty);
    }
    for _ in 0..TRIES {
        let snapshot = target.join(store::FILE_NAME);
        // Reading alone: the service stays the only writer.
        let source = Connection::open_with_flags(&file, OpenFlags::SQLITE_OPEN_READ_ONLY).map_err(StoreError::from)?;
        source.busy_timeout(std::time::Duration::from_secs(10)).map_err(StoreError::from)?;
        source.execute("VACUUM INTO ?1", [snapshot.to_string_lossy()]).map_err(StoreError::from)?;
        drop(source);
        if copy_files(data, target)? {
            drop(DataDirectory::open(target)?);
            artifacts::sync_directory(target)?;
            return Ok(());
        }
        // All of it was made here.
        for entry in fs::read_dir(target)? {
            let entry = entry?;
            let path = entry.path();
            if entry.file_type()?.is_dir() { fs::remove_dir_all(path)? } else { fs::remove_file(path)? }
        }
    }
    Err(BackupError::Restless)
}

/// Copies what the snapshot lists; false when something listed is gone or damaged.
fn copy_files(data: &Path, target: &Path) -> Result<bool, BackupError> {
    let copy = Store::open(target)?;
    let is_whole = copy_listed(data, &copy);
    copy.close();
    is_whole
}

fn copy_listed(data: &Path, copy: &Store) -> Result<bool, BackupError> {
    for upload in copy.uploads(None, u64::MAX >> 1)? {
        copy_tree(&data.join(store::UPLOADS).join(&upload.id), &copy.upload_directory(&upload.id))?;
        let content = copy.upload_directory(&upload.id).join(CONTENT);
        if !fs::metadata(content).is_ok_and(|meta| meta.len() == upload.size_bytes) {
            return Ok(false);
        }
    }
    for job in copy.list(&store::JobFilter { limit: u64::MAX >> 1, oldest_first: true, ..Default::default() })? {
        let into = copy.job_directory(&job.id);
        // Everything the job has, so that a running attempt's records and series come along; attempts that began after the
        // snapshot are not in its database.
        let from = data.join(store::JOBS).join(&job.id);
        let start = from.join(START_CHECKPOINT);
        if start.is_file() {
            fs::create_dir_all(&into)?;
            copy_file(&start, &into.join(START_CHECKPOINT))?;
        }
        for attempt in 1..=job.attempt {
            copy_tree(&attempt_directory(&from, attempt), &attempt_directory(&into, attempt))?;
        }
        let listed = copy.files(&job.id)?.into_iter().filter(|f| f.content.is_none());
        let listed = listed.map(|f| (f.attempt, f.path, f.size_bytes));
        let checkpoints = copy.checkpoints(&job.id)?.into_iter().map(|c| (c.attempt, c.path, c.size_bytes));
        for (attempt, path, size) in listed.chain(checkpoints) {
            let found = fs::metadata(attempt_directory(&into, attempt).join(&path)).map(|meta| meta.len());
            if !found.is_ok_and(|found| found == size) {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

fn copy_file(from: &Path, to: &Path) -> io::Result<()> {
    fs::copy(from, to)?;
    fs::File::open(to)?.sync_all()
}

fn copy_tree(from: &Path, to: &Path) -> io::Result<()> {
    let entries = match fs::read_dir(from) {
        // A job that has not run has no directory.
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries?,
    };
    fs::create_dir_all(to)?;
    for entry in entries {
        let entry = entry?;
        let target = to.join(entry.file_name());
        let copied = match entry.file_type()? {
            kind if kind.is_dir() => copy_tree(&entry.path(), &target),
            _ => copy_file(&entry.path(), &target),
        };
        match copied {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    Ok(())
}
