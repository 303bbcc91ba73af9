//! Jobs on a Slurm cluster, by its command line: `sbatch`, `squeue`, `scancel` and `scontrol`.
//!
//! The database of the service is the queue; the cluster gets a window of it. One job of the cluster is one attempt, and its name
//! is the key: it is looked up before anything is repeated. What an attempt has done stands in its files; what its process
//! does, the cluster knows. The two are not mixed: an answer of the cluster never says what was computed.
//!
//! Threads: `submission` runs `sbatch`, `errands` runs `scancel` and `scontrol`, `poller` runs one `squeue` for all, `files` looks at signs of life.
//! No call of the supervisor waits for any of them.

mod bundling;
mod command;
mod errands;
mod files;
mod poller;
mod script;
mod submission;
mod table;
mod ticket;
mod tracking;
mod worker;

use super::{Adoption, AttemptPlace, Capacity, Executor, Needs, NotStarted, Notify, Orphans, Reservation, Worker};
use crate::spec::attempt_files;
use crate::system::breakpoints::pass;
use crate::system::digest;
use errands::{Errand, Errands};
use files::Files;
use std::collections::{HashMap, HashSet};
use std::fs::OpenOptions;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use submission::Submitter;
use table::Table;
use ticket::{ClusterJob, Order, Stage, Ticket};
use worker::SlurmWorker;

/// How the cluster is used.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The program on every node, and the digest that it must have.
    pub program: PathBuf,
    /// Digest of the program.
    pub program_sha256: String,
    /// Id of the service, for people looking at the cluster's table.
    pub service_id: String,
    /// Directory of the cluster's commands; they are looked for as usual where there is none.
    pub commands: Option<PathBuf>,
    /// Options of `sbatch` that the site needs, such as its partition and account.
    pub options: Vec<String>,
    /// Jobs that the cluster has at once, waiting ones included.
    pub window: usize,
    /// Attempts that a bundle works on at once.
    pub lanes: usize,
    /// Least time between two looks at the cluster's table.
    pub poll: Duration,
    /// Least time between two submissions.
    pub submission_interval: Duration,
    /// Time that a file may take from one node to another.
    pub late_files: Duration,
    /// Time between two signs of life of a worker.
    pub heartbeat: Duration,
    /// Time without one after which a worker is given up.
    pub lease: Duration,
    /// The cluster's limit of time; none where the partition's own will do.
    pub time_limit: Option<Duration>,
    /// Time before the limit at which a worker is told to write its checkpoint.
    pub grace: Duration,
    /// Whether workers write a checkpoint and end when the service stops.
    pub drains: bool,
}

impl Settings {
    /// The rules for a program with its digest.
    #[must_use]
    pub fn new(program: PathBuf, program_sha256: String) -> Self {
        Self {
            program,
            program_sha256,
            service_id: String::new(),
            commands: None,
            options: Vec::new(),
            window: 200,
            lanes: 1,
            poll: Duration::from_secs(30),
            submission_interval: Duration::from_millis(500),
            late_files: Duration::from_secs(90),
            heartbeat: Duration::from_secs(15),
            lease: Duration::from_secs(180),
            time_limit: None,
            grace: Duration::from_secs(60),
            drains: false,
        }
    }
}

/// Why the cluster cannot be used as it was configured.
#[derive(Debug, thiserror::Error)]
pub enum SettingsError {
    /// The program cannot be read.
    #[error("the program {} cannot be read: {error}", path.display())]
    Program {
        /// Its path.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
    /// A path has characters that have a meaning to a shell.
    #[error("{} cannot be used on the cluster: its path may have letters, digits and -_./ only", .0.display())]
    Path(PathBuf),
    /// An option is none of the site's.
    #[error("executor.options: {0}")]
    Option(String),
    /// A thread could not be started.
    #[error("{0}")]
    Thread(#[from] io::Error),
}

impl Settings {
    /// Settings for a program, whose digest is taken.
    ///
    /// # Errors
    /// [`SettingsError::Program`].
    pub fn for_program(path: &Path) -> Result<Self, SettingsError> {
        let failed = |error| SettingsError::Program { path: path.to_owned(), error };
        let (sha256, _) = digest::of_file(path).map_err(failed)?;
        Ok(Self::new(path.to_owned(), sha256))
    }

    /// Nodes that the site's own options leave out.
    fn excluded(&self) -> Option<&str> {
        self.options.iter().rev().find_map(|option| option.strip_prefix("--exclude="))
    }

    /// A command of the cluster.
    fn command(&self, name: &str) -> PathBuf {
        self.commands.as_ref().map_or_else(|| PathBuf::from(name), |directory| directory.join(name))
    }

    fn check(&self, shared: &Path) -> Result<(), SettingsError> {
        for path in [&self.program, shared] {
            if !script::is_plain(path) {
                return Err(SettingsError::Path(path.to_owned()));
            }
        }
        match self.options.iter().find_map(|option| script::wrong_option(option)) {
            Some(wrong) => Err(SettingsError::Option(wrong)),
            None => Ok(()),
        }
    }
}

/// What the threads of the executor share.
struct Cluster {
    settings: Settings,
    /// Directory that every node sees under this path.
    shared: PathBuf,
    table: Mutex<Table>,
    files: Files,
    errands: Errands,
    losses: Mutex<HashMap<String, Vec<Instant>>>,
    /// Tickets of all attempts that are watched, by their names.
    tickets: Mutex<HashMap<String, Ticket>>,
    /// Bundles of which no attempt is left.
    left_over: Mutex<HashSet<String>>,
    /// Whether the next look at the table is wanted soon.
    poll_soon: (Mutex<bool>, Condvar),
}

/// Losses within this time make a node suspicious.
const LOSS_WINDOW: Duration = Duration::from_secs(60);
/// Losses within that time after which a node is left out.
const LOSSES: usize = 2;
/// Time for which it is left out.
const EXCLUSION: Duration = Duration::from_secs(3600);

impl Cluster {
    fn table(&self) -> MutexGuard<'_, Table> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Wants the next look at the table soon.
    fn poll_soon(&self) {
        let (wanted, condition) = &self.poll_soon;
        *wanted.lock().unwrap_or_else(PoisonError::into_inner) = true;
        condition.notify_all();
    }

    /// Notes that a node has lost an attempt.
    fn note_loss(&self, node: &str) {
        let mut losses = self.losses.lock().unwrap_or_else(PoisonError::into_inner);
        let times = losses.entry(node.to_owned()).or_default();
        times.push(Instant::now());
        if times.len() >= LOSSES && times[times.len() - LOSSES].elapsed() <= LOSS_WINDOW {
            tracing::warn!(node, "this node lost two attempts within a minute; it is left out for an hour");
        }
    }

    /// Nodes that are left out.
    fn excluded(&self) -> Vec<String> {
        let mut losses = self.losses.lock().unwrap_or_else(PoisonError::into_inner);
        losses.retain(|_, times| times.last().is_some_and(|last| last.elapsed() < EXCLUSION));
        let is_bad = |times: &Vec<Instant>| times.windows(LOSSES).any(|pair| pair[LOSSES - 1] - pair[0] <= LOSS_WINDOW);
        let mut nodes: Vec<String> =
            losses.iter().filter(|(_, times)| is_bad(times)).map(|(node, _)| node.clone()).collect();
        nodes.sort();
        nodes
    }

    fn tickets(&self) -> MutexGuard<'_, HashMap<String, Ticket>> {
        self.tickets.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn watch(&self, name: &str, ticket: &Ticket) {
        self.tickets().insert(name.to_owned(), ticket.clone());
    }

    /// Watches an attempt no longer. A bundle whose last attempt has ended is left over; at a stop of the service nothing has.
    fn forget(&self, name: &str, has_ended: bool) {
        let mut tickets = self.tickets();
        let job = tickets.remove(name).map(|ticket| ticket.job()).filter(ClusterJob::is_bundled);
        let last = job.filter(|job| has_ended && !tickets.values().any(|ticket| ticket.job().name == job.name));
        drop(tickets);
        self.files.forget(name);
        if let Some(job) = last {
            self.left_over.lock().unwrap_or_else(PoisonError::into_inner).insert(job.name);
        }
    }

    /// Ends bundles of which no attempt is left, and removes their lists once the cluster does not have them any more.
    fn clear_bundles(&self, table: &Table) {
        let mut left_over = self.left_over.lock().unwrap_or_else(PoisonError::into_inner);
        left_over.retain(|name| {
            let alive = table.rows(name).iter().find(|row| row.state.is_alive());
            match alive {
                Some(row) => self.errands.send(Errand::End { name: name.clone(), id: Some(row.id.clone()) }),
                None => bundling::remove(&self.shared, name),
            }
            alive.is_some()
        });
    }

    /// Where in the cluster an attempt is looked for.
    fn job_of(&self, name: &str) -> Option<ClusterJob> {
        self.tickets().get(name).map(Ticket::job)
    }

    /// Numbers of watched attempts, and of those of which it is not known whether the cluster has them.
    fn counts(&self) -> (usize, usize) {
        let tickets = self.tickets();
        let unsure = tickets.values().filter(|ticket| matches!(ticket.stage(), Stage::Unsure { .. })).count();
        (tickets.len(), unsure)
    }

    /// Jobs that the cluster may have, and jobs that the attempts in line will be.
    fn places(&self) -> (usize, usize) {
        let tickets = self.tickets();
        let (mut jobs, mut long, mut short_s) = (HashSet::new(), 0, 0.0);
        for ticket in tickets.values() {
            match (ticket.stage(), ticket.short_s()) {
                (Stage::InLine { .. }, Some(seconds)) => short_s += seconds,
                (Stage::InLine { .. }, None) => long += 1,
                (Stage::Unsure { .. } | Stage::Accepted { .. }, _) => {
                    jobs.insert(ticket.job().name);
                }
                (Stage::Revoked, _) => {}
            }
        }
        (jobs.len(), bundling::places_for(long, short_s))
    }

    /// Jobs that the cluster may still get.
    fn free_places(&self) -> usize {
        self.settings.window.saturating_sub(self.places().0)
    }
}

/// Attempts that are watched at once: each costs memory and, in a bundle, a look now and then.
const MOST_WATCHED: usize = 2000;

/// Hands attempts to a Slurm cluster. Handles are the names of its jobs.
pub struct SlurmExecutor {
    cluster: Arc<Cluster>,
    submitter: Submitter,
}

impl SlurmExecutor {
    /// Starts the threads. Attempts lie below `shared`, which every node sees under the same path.
    ///
    /// # Errors
    /// [`SettingsError`].
    pub fn new(settings: Settings, shared: &Path) -> Result<Self, SettingsError> {
        settings.check(shared)?;
        let look = settings.poll.min(files::LONGEST_INTERVAL);
        let cluster = Arc::new(Cluster {
            shared: shared.to_owned(),
            table: Mutex::new(Table::new()),
            files: Files::default(),
            errands: Errands::start(&settings)?,
            losses: Mutex::default(),
            tickets: Mutex::default(),
            left_over: Mutex::default(),
            poll_soon: (Mutex::new(false), Condvar::new()),
            settings,
        });
        poller::start(Arc::downgrade(&cluster))?;
        files::start(Arc::downgrade(&cluster), look)?;
        let submitter = Submitter::start(Arc::downgrade(&cluster))?;
        Ok(Self { cluster, submitter })
    }

    fn worker(&self, attempt: &AttemptPlace, needs: &Needs, notify: Notify, stage: Stage) -> SlurmWorker {
        let name = script::name_of(&attempt.job, attempt.epoch);
        let job = bundling::job_of(&attempt.directory, name.clone());
        let ticket = Ticket::new(stage, job, bundling::short_s(needs));
        self.cluster.watch(&name, &ticket);
        self.cluster.files.watch(&name, &attempt.directory, notify);
        let order = Order { attempt: attempt.clone(), needs: *needs, ticket };
        SlurmWorker::new(name, order, Arc::clone(&self.cluster), self.submitter.clone())
    }
}

impl Executor for SlurmExecutor {
    fn start(&self, attempt: &AttemptPlace, needs: &Needs, notify: Notify) -> Result<Box<dyn Worker>, NotStarted> {
        // Everything that either side reads is there from the beginning: another machine remembers what it did not find.
        for name in [attempt_files::CONTROL, attempt_files::LOG] {
            OpenOptions::new().create(true).append(true).open(attempt.directory.join(name))?;
        }
        let text = script::script(&attempt.directory, &self.cluster.settings);
        // The cluster takes a copy of it. One that a crash of this machine loses makes a further attempt, and no harm.
        std::fs::write(attempt.directory.join(attempt_files::SCRIPT), text)?;
        pass("slurm/scripted");
        let worker = self.worker(attempt, needs, notify, Stage::InLine { said: None });
        worker.submit();
        Ok(Box::new(worker))
    }

    /// An attempt that has a script may have been submitted, whether the service wrote that down or not.
    fn adopt(&self, attempt: &AttemptPlace, _: Option<&str>, needs: &Needs, notify: Notify) -> Adoption {
        let script = std::fs::metadata(attempt.directory.join(attempt_files::SCRIPT));
        if script.is_err_and(|error| error.kind() == io::ErrorKind::NotFound) {
            return Adoption::Gone;
        }
        self.cluster.poll_soon();
        Adoption::Running(Box::new(self.worker(attempt, needs, notify, Stage::Unsure { since: Instant::now() })))
    }

    fn capacity(&self, _: &[Reservation]) -> Capacity {
        let ((watched, _), (jobs, in_line)) = (self.cluster.counts(), self.cluster.places());
        let free = self.cluster.settings.window.saturating_sub(jobs + in_line);
        Capacity { memory_bytes: u64::MAX, workers: free.min(MOST_WATCHED.saturating_sub(watched)) }
    }

    fn late_files(&self) -> Duration {
        self.cluster.settings.late_files
    }

    fn outlives_service(&self) -> bool {
        !self.cluster.settings.drains
    }

    fn orphans(&self) -> Option<Orphans> {
        let cluster = Arc::clone(&self.cluster);
        Some(Arc::new(move |job, epoch| {
            let name = script::name_of(job, epoch);
            cluster.table().rows(&name).iter().any(|row| row.state.is_alive())
        }))
    }
}

#[cfg(test)]
mod tests;
