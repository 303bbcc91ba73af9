//! Looks at what running attempts write: the size of their records and their signs of life. It is done on a thread of its own,
//! since a shared file system may let a look hang, and each file is opened anew, so that a look sees what another machine has closed.

use super::Cluster;
use super::ticket::ClusterJob;
use crate::service::executor::Notify;
use crate::spec::attempt_files;
use crate::spec::heartbeat::Heartbeat;
use std::collections::HashMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

/// Longest time between two looks.
pub(super) const LONGEST_INTERVAL: Duration = Duration::from_secs(2);

/// Attempts of a bundle that are looked at beyond those whose turn it is.
const AHEAD: usize = 8;

/// What was last seen of an attempt.
#[derive(Debug, Clone, Default)]
pub(super) struct Seen {
    /// Size of its records.
    pub(super) records_bytes: u64,
    /// Its last sign of life.
    pub(super) heartbeat: Option<Heartbeat>,
    /// When one of the two last changed, by this machine's clock.
    pub(super) changed: Option<Instant>,
    /// When a look last got an answer of the file system.
    pub(super) looked: Option<Instant>,
    /// Whether the claim is taken though it has no owner.
    pub(super) is_claimed: bool,
    /// Number of the cluster's job that claimed it.
    pub(super) owner: Option<String>,
    /// Whether the cluster put that job back into its queue and it came to the claim again.
    pub(super) was_requeued: bool,
    /// Whether there may be records that are not read yet.
    pub(super) has_news: bool,
}

impl Seen {
    /// Whether a process of the attempt has begun.
    pub(super) fn has_begun(&self) -> bool {
        self.gave_life() || self.owner.is_some() || self.is_claimed
    }

    /// Whether its program has done anything.
    pub(super) fn gave_life(&self) -> bool {
        self.heartbeat.is_some() || self.records_bytes > 0
    }

    /// Takes what a look has found; whether anything is new.
    fn take(&mut self, found: Look) -> bool {
        let Look { records_bytes, heartbeat, owner, was_requeued, is_answer } = found;
        if is_answer {
            self.looked = Some(Instant::now());
        }
        let is_new = records_bytes > self.records_bytes || heartbeat.is_some() && heartbeat != self.heartbeat;
        if is_new {
            self.records_bytes = records_bytes.max(self.records_bytes);
            self.heartbeat = heartbeat.or(self.heartbeat.take());
            self.changed = Some(Instant::now());
            self.has_news = true;
        }
        self.owner = owner.or(self.owner.take());
        self.was_requeued |= was_requeued;
        is_new
    }
}

struct Watched {
    directory: PathBuf,
    notify: Notify,
    seen: Seen,
}

/// The attempts that are looked at, by their names.
#[derive(Default)]
pub(super) struct Files(Mutex<HashMap<String, Watched>>);

impl Files {
    fn held(&self) -> MutexGuard<'_, HashMap<String, Watched>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Looks at an attempt from now on.
    pub(super) fn watch(&self, name: &str, directory: &Path, notify: Notify) {
        // What an attempt wrote before this service watched it was imported at the start, or is news.
        let seen = Seen { has_news: true, ..Seen::default() };
        self.held().insert(name.to_owned(), Watched { directory: directory.to_owned(), notify, seen });
    }

    /// Looks at it no longer.
    pub(super) fn forget(&self, name: &str) {
        self.held().remove(name);
    }

    /// What was last seen of an attempt.
    pub(super) fn seen(&self, name: &str) -> Seen {
        self.held().get(name).map(|watched| watched.seen.clone()).unwrap_or_default()
    }

    /// Whether there was something to read since the last call.
    pub(super) fn take_news(&self, name: &str) -> bool {
        self.held().get_mut(name).is_some_and(|watched| std::mem::take(&mut watched.seen.has_news))
    }

    /// Takes one look at every attempt that may be at work: of a bundle, at those whose turn is near. The lock is not held while a
    /// file system is asked.
    fn look(&self, job_of: impl Fn(&str) -> Option<ClusterJob>, lanes: usize) {
        let places: Vec<(String, PathBuf, bool, Option<ClusterJob>)> = self
            .held()
            .iter()
            .map(|(name, watched)| (name.clone(), watched.directory.clone(), watched.seen.has_begun(), job_of(name)))
            .collect();
        let mut turns: HashMap<String, (usize, usize)> = HashMap::new();
        for (_, _, has_begun, job) in &places {
            if let Some(ClusterJob { name, place: Some(place) }) = job {
                let (first, begun) = turns.entry(name.clone()).or_insert((*place, 0));
                *first = (*first).min(*place);
                *begun = if *has_begun { (*begun).max(*place) } else { *begun };
            }
        }
        let is_near = |job: &Option<ClusterJob>| match job {
            Some(ClusterJob { name, place: Some(place) }) => {
                turns.get(name).is_some_and(|(first, begun)| *place <= (*first).max(*begun) + lanes + AHEAD)
            }
            _ => true,
        };
        for (name, directory, _, _) in places.iter().filter(|(_, _, _, job)| is_near(job)) {
            let found = Look::at(directory);
            if let Some(watched) = self.held().get_mut(name)
                && watched.seen.take(found)
            {
                (watched.notify)();
            }
        }
    }
}

/// What one look has found.
struct Look {
    records_bytes: u64,
    heartbeat: Option<Heartbeat>,
    owner: Option<String>,
    was_requeued: bool,
    /// Whether the file system answered; that a file is not there is an answer.
    is_answer: bool,
}

impl Look {
    fn at(directory: &Path) -> Self {
        let size =
            |name: &str| File::open(directory.join(name)).and_then(|file| file.metadata()).map(|meta| meta.len());
        let records = size(attempt_files::RECORDS);
        let is_answer = records.as_ref().err().is_none_or(|error| error.kind() == io::ErrorKind::NotFound);
        let claim = directory.join(attempt_files::CLAIM);
        let text = std::fs::read_to_string(claim.join(attempt_files::CLAIM_OWNER)).ok();
        // The number of a restart follows the number of the job.
        let owner = text.and_then(|text| text.trim().split('.').next().map(str::to_owned)).filter(|id| !id.is_empty());
        Self {
            is_answer,
            records_bytes: records.unwrap_or(0),
            heartbeat: Heartbeat::read(directory),
            was_requeued: owner.as_ref().is_some_and(|id| came_second(&claim, id)),
            owner,
        }
    }
}

/// Whether a job came to a claim that was taken already.
fn came_second(claim: &Path, id: &str) -> bool {
    let mark = format!("second-{id}.");
    let mut entries = std::fs::read_dir(claim).into_iter().flatten().flatten();
    entries.any(|entry| entry.file_name().to_str().is_some_and(|name| name.starts_with(&mark)))
}

/// Starts the thread; it ends with the cluster.
pub(super) fn start(cluster: Weak<Cluster>, interval: Duration) -> io::Result<()> {
    std::thread::Builder::new().name("slurm-files".to_owned()).spawn(move || {
        while let Some(cluster) = cluster.upgrade() {
            cluster.files.look(|name| cluster.job_of(name), cluster.settings.lanes);
            drop(cluster);
            std::thread::sleep(interval);
        }
    })?;
    Ok(())
}
