//! What killed attempts leave behind: half-written files, frames that were written again, checkpoints whose record did
//! not get out. While nobody works on a job, everything in its attempts that the store does not list is of no use.

use crate::order::attempt_directory;
use crate::store::{Store, StoreError};
use std::collections::HashSet;
use std::fs;
use std::path::PathBuf;

/// Removes frames and checkpoints of a job that the store does not list. Only for jobs without a worker whose records
/// are all imported.
///
/// # Errors
/// [`StoreError`].
pub(super) fn remove(store: &Store, job: &str) -> Result<(), StoreError> {
    let directory = store.job_directory(job);
    let files = store.files(job)?.into_iter().map(|file| (file.attempt, file.path));
    let checkpoints = store.checkpoints(job)?.into_iter().map(|row| (row.attempt, row.path));
    let listed: HashSet<PathBuf> =
        files.chain(checkpoints).map(|(attempt, path)| attempt_directory(&directory, attempt).join(path)).collect();
    let attempts = fs::read_dir(directory.join("attempts")).into_iter().flatten().flatten();
    for folder in attempts.flat_map(|attempt| ["frames", "checkpoints"].map(|name| attempt.path().join(name))) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            if !listed.contains(&entry.path()) {
                match fs::remove_file(entry.path()) {
                    Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error.into()),
                    _ => {}
                }
            }
        }
    }
    Ok(())
}
