//! Checks a data directory that no service is using: whether the store is intact, consistent, and in agreement with the
//! files beside it.

use crate::service::data_directory::{DataDirectory, DataDirectoryError};
use crate::service::found_folders;
use crate::service::store::uploads::{CLOUD, CONTENT};
use crate::service::store::{self, JobFilter, JobRow, START_CHECKPOINT, Store, StoreError};
use crate::spec::attempt_files::attempt_directory;
use crate::spec::states::State;
use crate::system::digest;
use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// One thing that is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// Where: an id, or the store.
    pub place: String,
    /// What is wrong there.
    pub what: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        write!(formatter, "{}: {}", self.place, self.what)
    }
}

/// Counts of what was checked, and everything that is wrong.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Findings {
    /// Number of jobs.
    pub jobs: usize,
    /// Files whose digests were taken.
    pub files: usize,
    /// What is wrong.
    pub wrong: Vec<Finding>,
    /// Folders that an earlier start has set aside.
    pub set_aside: Vec<String>,
}

/// Why the check could not be made.
#[derive(Debug, thiserror::Error)]
pub enum FsckError {
    /// A service uses the directory, or it is not ours.
    #[error("{0}; stop a service that uses it, or look over a copy (meniscus backup)")]
    Directory(#[from] DataDirectoryError),
    /// The store cannot be opened.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// There is no store.
    #[error("{} has no database {}; give --data a data directory of meniscus", .0.display(), store::FILE_NAME)]
    NoStore(PathBuf),
    /// The system failed.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// Rows that are read at once.
const CHUNK: u64 = 500;

/// Checks a data directory. Nothing is changed, except that the schema is brought up to date as any start would.
///
/// # Errors
/// [`FsckError`].
pub fn check(data: &Path) -> Result<Findings, FsckError> {
    if !data.join(store::FILE_NAME).is_file() {
        return Err(FsckError::NoStore(data.to_owned()));
    }
    let data = DataDirectory::open_existing(data)?;
    let store = Store::open(data.path())?;
    let mut findings = Findings::default();
    for what in store.integrity()? {
        findings.wrong.push(Finding { place: "store".to_owned(), what });
    }
    let mut filter = JobFilter { limit: CHUNK, oldest_first: true, ..JobFilter::default() };
    loop {
        let jobs = store.list(&filter)?;
        for job in &jobs {
            of_job(&store, job, &mut findings)?;
        }
        match jobs.last() {
            Some(last) => filter.cursor = Some(last.id.clone()),
            None => break,
        }
    }
    of_uploads(&store, &mut findings)?;
    of_folders(&store, &mut findings)?;
    store.close();
    Ok(findings)
}

fn of_job(store: &Store, job: &JobRow, findings: &mut Findings) -> Result<(), FsckError> {
    findings.jobs += 1;
    let mut wrong = Vec::new();
    if job.state.is_terminal() != job.finished_at.is_some() {
        let finished_at = job.finished_at.as_deref().unwrap_or("no time");
        wrong.push(format!("it is {} and finished at {finished_at}", job.state.word()));
    }
    if !store.events_are_whole(&job.id)? {
        wrong.push("its events are not numbered from 1 without gaps".to_owned());
    }
    let last = store.state_of_last_event(&job.id)?;
    if last != Some(job.state) {
        let last = last.map_or("no state", State::word);
        wrong.push(format!("its last event says {last}, its row {}", job.state.word()));
    }
    let directory = store.job_directory(&job.id);
    let listed = store.files(&job.id)?.into_iter().filter(|file| file.content.is_none());
    let listed = listed.map(|file| (file.attempt, file.path, file.size_bytes, file.sha256));
    let checkpoints = store.checkpoints(&job.id)?.into_iter().map(|c| (c.attempt, c.path, c.size_bytes, c.sha256));
    for (attempt, path, size, sha256) in listed.chain(checkpoints) {
        findings.files += 1;
        wrong.extend(of_file(&attempt_directory(&directory, attempt).join(&path), &path, size, &sha256));
    }
    if let Some(sha256) = job.restart_sha256.as_ref().filter(|_| !job.state.is_terminal()) {
        let start = directory.join(START_CHECKPOINT);
        let size = fs::metadata(&start).map_or(0, |meta| meta.len());
        wrong.extend(of_file(&start, START_CHECKPOINT, size, sha256));
    }
    if job.state == State::Succeeded && job.results.is_none() {
        wrong.push("it has succeeded without results".to_owned());
    }
    findings.wrong.extend(wrong.into_iter().map(|what| Finding { place: job.id.clone(), what }));
    Ok(())
}

/// What is wrong with a file, if anything is.
fn of_file(path: &Path, name: &str, size: u64, sha256: &str) -> Option<String> {
    match digest::of_file(path) {
        Err(error) => Some(format!("{name} cannot be read: {}", error.kind())),
        Ok((_, found)) if found != size => Some(format!("{name} has {found} bytes instead of {size}")),
        Ok((found, _)) if found != sha256 => Some(format!("{name} has another digest than the store")),
        Ok(_) => None,
    }
}

fn of_uploads(store: &Store, findings: &mut Findings) -> Result<(), FsckError> {
    let mut cursor: Option<String> = None;
    loop {
        let uploads = store.uploads(cursor.as_deref(), CHUNK)?;
        for upload in &uploads {
            findings.files += 1;
            let directory = store.upload_directory(&upload.id);
            let mut wrong: Vec<String> =
                of_file(&directory.join(CONTENT), CONTENT, upload.size_bytes, &upload.sha256).into_iter().collect();
            let has_points = upload.found.as_ref().is_some_and(|found| found.points().is_some());
            if has_points && !directory.join(CLOUD).is_file() {
                wrong.push("its points are missing".to_owned());
            }
            findings.wrong.extend(wrong.into_iter().map(|what| Finding { place: upload.id.clone(), what }));
        }
        match uploads.last() {
            Some(last) => cursor = Some(last.id.clone()),
            None => return Ok(()),
        }
    }
}

/// Folders that the database does not know.
fn of_folders(store: &Store, findings: &mut Findings) -> Result<(), FsckError> {
    let found = found_folders::compare(store.directory(), Some(store))?;
    let lost = "the database does not know it, or not its latest attempt: it was lost or is older; `serve --adopt` brings it back";
    let ids = found.jobs.into_iter().map(|job| job.id).chain(found.uploads.into_iter().map(|upload| upload.id));
    findings.wrong.extend(ids.map(|place| Finding { place, what: lost.to_owned() }));
    let place = |path: &Path| path.strip_prefix(store.directory()).unwrap_or(path).display().to_string();
    let orphan = "it belongs to no job and no upload; the next start sets it aside";
    findings.wrong.extend(found.orphans.iter().map(|path| Finding { place: place(path), what: orphan.to_owned() }));
    let aside = found_folders::set_aside_so_far(store.directory())?;
    findings.set_aside = aside.iter().map(|path| place(path)).collect();
    Ok(())
}
