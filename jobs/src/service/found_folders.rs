//! Folders of jobs and uploads on the disk, compared with the database when the service starts.
//!
//! A folder with a sound record of its own that the database does not know means that the database was lost or is older: then
//! the start is refused, or the folders are adopted. Folders with our names and without such a record are set aside. Anything
//! else in the data directory belongs to others and stays as it is.

use crate::service::data_directory::ORPHANS;
use crate::service::store::uploads::{CONTENT, UploadRecord};
use crate::service::store::{self, JOBS, Store, StoreError, UPLOADS};
use crate::spec::attempt_files::{ATTEMPT_SPEC, attempt_directory};
use crate::spec::attempt_spec::AttemptSpec;
use std::collections::HashSet;
use std::io;
use std::path::{Path, PathBuf};
use ulid::Ulid;

/// A job folder with attempts that the database does not know.
#[derive(Debug, Clone)]
pub struct FoundJob {
    /// Id of the job.
    pub id: String,
    /// The latest attempt on the disk.
    pub last_attempt: u64,
    /// The specification of that attempt.
    pub spec: AttemptSpec,
    /// Whether the database knows the job, but not its latest attempt.
    pub is_known: bool,
}

/// What the database does not know.
#[derive(Debug, Clone, Default)]
pub struct FoundFolders {
    /// Jobs with attempts that it does not know.
    pub jobs: Vec<FoundJob>,
    /// Uploads that it does not know.
    pub uploads: Vec<UploadRecord>,
    /// Folders with names of ours and without a sound record.
    pub orphans: Vec<PathBuf>,
}

/// The database was lost or is older than the folders beside it.
#[derive(Debug, thiserror::Error)]
#[error(
    "the database {} {}: {} on the disk {} not in it ({}). Put back the newest copy of {}, or start with --adopt, which brings them \
     back from their own files",
    database.display(),
    if *is_missing { "is missing" } else { "is older than the files beside it" },
    if *count == 1 { "one job or upload".to_owned() } else { format!("{count} jobs and uploads") },
    if *count == 1 { "is" } else { "are" },
    examples.join(", "),
    store::FILE_NAME
)]
pub struct DatabaseLost {
    database: PathBuf,
    is_missing: bool,
    count: usize,
    examples: Vec<String>,
}

/// Ids that a message shows.
const EXAMPLES: usize = 3;

impl FoundFolders {
    /// Whether there is nothing that the database has lost.
    #[must_use]
    pub fn is_nothing_lost(&self) -> bool {
        self.jobs.is_empty() && self.uploads.is_empty()
    }

    /// The reason to refuse a start.
    #[must_use]
    pub fn lost(&self, directory: &Path, is_missing: bool) -> DatabaseLost {
        let ids = self.jobs.iter().map(|job| job.id.clone()).chain(self.uploads.iter().map(|upload| upload.id.clone()));
        DatabaseLost {
            database: directory.join(store::FILE_NAME),
            is_missing,
            count: self.jobs.len() + self.uploads.len(),
            examples: ids.take(EXAMPLES).collect(),
        }
    }
}

/// Compares the folders of a data directory with its database; without a database it knows nothing.
///
/// # Errors
/// [`StoreError`].
pub fn compare(directory: &Path, store: Option<&Store>) -> Result<FoundFolders, StoreError> {
    let mut found = FoundFolders::default();
    // A deletion that has begun is no loss.
    let leaving: HashSet<String> = store.map(Store::intended_deletions).transpose()?.into_iter().flatten().collect();
    let known = store.map(Store::attempts).transpose()?.unwrap_or_default();
    for folder in folders_of_ours(&directory.join(JOBS), "job_")? {
        let id = name_of(&folder);
        if leaving.contains(&format!("{JOBS}/{id}")) {
            continue;
        }
        let (numbers, listed) = (attempt_numbers(&folder), known.get(&id));
        // Of what the database knows no file is opened: there may be very many jobs.
        if listed.is_some_and(|attempt| numbers.first().is_none_or(|last| last <= attempt)) {
            continue;
        }
        match (latest_attempt(&folder, &id, numbers), listed) {
            (Some((last_attempt, _)), Some(attempt)) if last_attempt <= *attempt => {}
            (Some((last_attempt, spec)), listed) => {
                found.jobs.push(FoundJob { id, last_attempt, spec, is_known: listed.is_some() });
            }
            (None, Some(_)) => {}
            (None, None) => found.orphans.push(folder),
        }
    }
    for folder in folders_of_ours(&directory.join(UPLOADS), "upl_")? {
        let id = name_of(&folder);
        let is_known = store.map(|store| store.knows(&id)).transpose()?.unwrap_or(false);
        if is_known || leaving.contains(&format!("{UPLOADS}/{id}")) {
            continue;
        }
        match UploadRecord::read(&folder).filter(|record| record.id == id && folder.join(CONTENT).is_file()) {
            Some(record) => found.uploads.push(record),
            None => found.orphans.push(folder),
        }
    }
    Ok(found)
}

/// Brings lost jobs and uploads back into the database.
///
/// # Errors
/// [`StoreError`].
pub fn adopt(store: &Store, found: &FoundFolders) -> Result<(), StoreError> {
    // Jobs may take points from uploads.
    for upload in &found.uploads {
        store.adopt_upload(upload)?;
        tracing::info!(upload = upload.id, "adopted");
    }
    for job in &found.jobs {
        if !job.is_known {
            store.adopt_job(&job.spec)?;
        }
        let row = store.job(&job.id)?;
        let first = row.as_ref().map_or(1, |row| if row.state.has_worker() { row.attempt } else { row.attempt + 1 });
        store.replay_attempts(&job.id, first, job.last_attempt)?;
        let state = store.state(&job.id)?.map_or("gone", crate::spec::states::State::word);
        tracing::info!(job = job.id, attempts = job.last_attempt, state, "adopted");
    }
    Ok(())
}

/// Moves folders to `orphans/` in the data directory.
///
/// # Errors
/// When the system refuses.
pub fn set_aside(directory: &Path, orphans: &[PathBuf]) -> io::Result<()> {
    let place = directory.join(ORPHANS);
    for folder in orphans {
        std::fs::create_dir_all(&place)?;
        let name = name_of(folder);
        let free = (1_u32..).map(|k| place.join(if k == 1 { name.clone() } else { format!("{name}.{k}") }));
        let Some(target) = free.into_iter().find(|target| !target.exists()) else { continue };
        std::fs::rename(folder, &target)?;
        tracing::warn!(from = %folder.display(), to = %target.display(), "not in the database; set aside");
    }
    Ok(())
}

/// What has been set aside so far.
///
/// # Errors
/// When the folder cannot be read.
pub fn set_aside_so_far(directory: &Path) -> io::Result<Vec<PathBuf>> {
    let place = directory.join(ORPHANS);
    if !place.is_dir() {
        return Ok(Vec::new());
    }
    let mut all: Vec<PathBuf> = std::fs::read_dir(place)?.map(|entry| Ok(entry?.path())).collect::<io::Result<_>>()?;
    all.sort();
    Ok(all)
}

/// Folders whose names this program gives: a prefix and a ULID.
fn folders_of_ours(parent: &Path, prefix: &str) -> io::Result<Vec<PathBuf>> {
    let entries = match std::fs::read_dir(parent) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut folders = Vec::new();
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name();
        let number =
            name.to_str().and_then(|name| name.strip_prefix(prefix)).and_then(|rest| rest.parse::<Ulid>().ok());
        if number.is_some() && entry.file_type()?.is_dir() {
            folders.push(entry.path());
        }
    }
    folders.sort();
    Ok(folders)
}

fn name_of(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Numbers of the attempts in a job folder, the latest first.
fn attempt_numbers(folder: &Path) -> Vec<u64> {
    let entries = std::fs::read_dir(folder.join("attempts")).into_iter().flatten().flatten();
    let mut numbers: Vec<u64> = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).collect();
    numbers.sort_unstable_by(|a, b| b.cmp(a));
    numbers
}

/// The latest attempt of a job folder with a sound specification.
fn latest_attempt(folder: &Path, job: &str, numbers: Vec<u64>) -> Option<(u64, AttemptSpec)> {
    numbers.into_iter().find_map(|number| {
        let text = std::fs::read(attempt_directory(folder, number).join(ATTEMPT_SPEC)).ok()?;
        let spec: AttemptSpec = serde_json::from_slice(&text).ok()?;
        (spec.job == job && spec.epoch == number).then_some((number, spec))
    })
}
