//! What killed attempts leave behind: half-written files, frames that were written again, checkpoints whose record did
//! not get out. While no worker runs, nothing reads them.

use crate::service::executor::Orphans;
use crate::service::store::{Store, StoreError};
use crate::spec::attempt_files::{self, attempt_directory};
use std::collections::HashSet;
use std::fs;
use std::path::PathBuf;

/// The folders that a worker writes into, with the ending of the files that it numbers there.
const NUMBERED: [(&str, &str); 2] = [
    (attempt_files::FRAMES, attempt_files::FRAME_ENDING),
    (attempt_files::CHECKPOINTS, attempt_files::CHECKPOINT_ENDING),
];

/// Removes frames and checkpoints of a job that the store does not list. Only for jobs without a worker whose records
/// are all imported. Attempts after `last_attempt`, those of which a process may still write, and files that no worker names so
/// stay where they are.
///
/// # Errors
/// [`StoreError`].
pub(super) fn remove(store: &Store, job: &str, last_attempt: u64, orphans: Option<&Orphans>) -> Result<(), StoreError> {
    let directory = store.job_directory(job);
    let files = store.files(job)?.into_iter().map(|file| (file.attempt, file.path));
    let checkpoints = store.checkpoints(job)?.into_iter().map(|row| (row.attempt, row.path));
    let listed: HashSet<PathBuf> =
        files.chain(checkpoints).map(|(attempt, path)| attempt_directory(&directory, attempt).join(path)).collect();
    for attempt in 1..=last_attempt {
        // The last one has ended: that is why this is called.
        if attempt < last_attempt && orphans.is_some_and(|writes| writes(job, attempt)) {
            continue;
        }
        for (folder, ending) in NUMBERED {
            let folder = attempt_directory(&directory, attempt).join(folder);
            for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
                let is_ours = entry.file_name().to_str().is_some_and(|name| is_numbered(name, ending));
                if !is_ours || listed.contains(&entry.path()) {
                    continue;
                }
                match fs::remove_file(entry.path()) {
                    Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error.into()),
                    _ => {}
                }
            }
        }
    }
    Ok(())
}

/// Whether a worker gives a file this name, whole or in the making: digits and the ending.
fn is_numbered(name: &str, ending: &str) -> bool {
    let whole = name.strip_suffix(".unfinished").unwrap_or(name);
    let number = whole.strip_suffix(ending).and_then(|rest| rest.strip_suffix('.'));
    let number = number.map(|rest| rest.strip_suffix(attempt_files::UNMEASURED).unwrap_or(rest));
    number.is_some_and(|digits| !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::is_numbered;

    #[test]
    fn only_names_that_workers_give_are_ours() {
        for name in ["000012.vtkhdf", "000012.vtkhdf.unfinished", "000012-unmeasured.vtkhdf"] {
            assert!(is_numbered(name, "vtkhdf"));
        }
        for name in ["notes.txt", ".vtkhdf", "best.vtkhdf", "000012.h5", "000012.vtkhdf.bak", "12vtkhdf"] {
            assert!(!is_numbered(name, "vtkhdf"), "{name}");
        }
    }
}
