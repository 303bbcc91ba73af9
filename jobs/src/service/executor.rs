//! Executors start workers and know whether they live. [`local`] starts child processes of the service; [`slurm`] hands attempts
//! to a cluster.
//!
//! The supervisor knows a worker by its handle, a text that the executor gives and that the store keeps. What a handle
//! means, where the program lies and how much memory there is belongs to the executor.

mod cgroup;
pub mod local;
pub mod slurm;

use crate::spec::requests::Request;
use crate::system::process;
use std::fmt;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// One attempt at a job, as an executor sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AttemptPlace {
    /// Id of the job.
    pub job: String,
    /// The attempt's number.
    pub epoch: u64,
    /// Its directory.
    pub directory: PathBuf,
}

/// What an attempt needs of the machine that it runs on.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Needs {
    /// Resident memory at most, in bytes.
    pub memory_bytes: u64,
    /// Threads of the worker.
    pub threads: u64,
    /// Running time at most, in seconds.
    pub wall_s: Option<f64>,
    /// Running time that is forecast, in seconds, where it is known.
    pub forecast_s: Option<f64>,
}

/// Called, from any thread, when a worker may have written something or has ended.
pub type Notify = Box<dyn Fn() + Send>;

/// Starts workers and finds those of an earlier service again.
pub trait Executor: Send {
    /// Starts a worker for the attempt specification in a directory. Never blocks: an executor with a queue hands over to it.
    ///
    /// # Errors
    /// [`NotStarted`].
    fn start(&self, attempt: &AttemptPlace, needs: &Needs, notify: Notify) -> Result<Box<dyn Worker>, NotStarted>;

    /// Looks for the worker of an earlier service. It has a handle where the service had written it down before it ended. A
    /// worker that cannot be taken over is ended.
    fn adopt(&self, attempt: &AttemptPlace, handle: Option<&str>, needs: &Needs, notify: Notify) -> Adoption;

    /// What new workers can have beside those that run.
    fn capacity(&self, reservations: &[Reservation]) -> Capacity;

    /// Time that files of an ended worker may take to be seen here.
    fn late_files(&self) -> Duration {
        Duration::ZERO
    }

    /// Whether workers go on when the service stops.
    fn outlives_service(&self) -> bool {
        false
    }

    /// Tells which attempts may still have a process that writes, though they have ended here; None where there can be none.
    fn orphans(&self) -> Option<Orphans> {
        None
    }
}

/// Whether an attempt of a job may still have a process that writes into its directory.
pub type Orphans = Arc<dyn Fn(&str, u64) -> bool + Send + Sync>;

/// A running worker.
pub trait Worker: Send {
    /// The name under which the executor finds it again.
    fn handle(&self) -> &str;

    /// Sends a request. A worker that is gone does not receive it; [`Worker::poll`] tells of its end.
    fn send(&mut self, request: Request);

    /// Time since its last sign of life.
    fn time_since_heartbeat(&self) -> Duration;

    /// Whether it runs, or waits in the executor's queue. Limits of time count while it runs.
    fn phase(&self) -> Phase;

    /// What it waits for, while it does.
    fn waits_for(&self) -> Option<String> {
        None
    }

    /// Whether it may have written records since the last call.
    fn has_news(&mut self) -> bool {
        true
    }

    /// What it uses now.
    fn usage(&self) -> WorkerUsage;

    /// How it ended; None while it has not.
    ///
    /// # Errors
    /// When the executor does not know.
    fn poll(&mut self) -> io::Result<Option<EndCause>>;

    /// Ends it at once.
    fn kill(&mut self);
}

/// Phase of a worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// In the executor's queue.
    Waiting,
    /// It computes.
    Running,
}

/// What a worker uses now; None where the executor cannot tell or limits it by itself.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct WorkerUsage {
    /// Resident memory in bytes.
    pub memory_bytes: Option<u64>,
}

/// Why a worker ended, as its executor sees it. What it computed stands in its records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndCause {
    /// By itself, with an exit code.
    Exited {
        /// The exit code.
        code: i32,
    },
    /// By a signal.
    Signaled {
        /// The signal's number.
        signal: i32,
    },
    /// The kernel ended it for lack of memory.
    OutOfMemory,
    /// The executor took it away, or never got it going. The job has not died of it.
    Evicted(Eviction),
}

/// Why an executor took a worker away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Eviction {
    /// The node failed.
    NodeLost,
    /// Another job took its place.
    Preempted,
    /// The cluster's limit of time was reached.
    TimeLimit,
    /// The cluster does not know it any more, and it gives no sign of life.
    Forgotten,
    /// It was taken out of the cluster's queue by hand.
    Revoked,
    /// The node did not grant what a worker needs to begin.
    NotBegun,
    /// It shared a job of the cluster with others, which ended before its turn.
    Unreached,
}

impl Eviction {
    /// Its word in metrics.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::NodeLost => "node_lost",
            Self::Preempted => "preempted",
            Self::TimeLimit => "time_limit",
            Self::Forgotten => "forgotten",
            Self::Revoked => "revoked",
            Self::NotBegun => "not_begun",
            Self::Unreached => "unreached",
        }
    }
}

impl fmt::Display for Eviction {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(match self {
            Self::NodeLost => "the node failed",
            Self::Preempted => "another job took its place on the node",
            Self::TimeLimit => "the cluster's limit of time was reached",
            Self::Forgotten => "the cluster does not know the job any more, and its worker gives no sign of life",
            Self::Revoked => "the job was taken out of the cluster's queue",
            Self::NotBegun => "the node did not grant what a worker needs to begin",
            Self::Unreached => "the bundle of short jobs ended before its turn",
        })
    }
}

/// Why a worker was not started.
#[derive(Debug, thiserror::Error)]
pub enum NotStarted {
    /// The device is full.
    #[error("the device is full: {0}")]
    OutOfSpace(io::Error),
    /// The system failed.
    #[error("{0}")]
    System(io::Error),
    /// The job that it continues has no checkpoint any more.
    #[error("the job that it continues has no checkpoint")]
    NoCheckpoint,
    /// The job cannot be read from the store.
    #[error("{0}")]
    Unreadable(String),
}

impl From<io::Error> for NotStarted {
    fn from(error: io::Error) -> Self {
        if process::is_out_of_space(&error) { Self::OutOfSpace(error) } else { Self::System(error) }
    }
}

/// What became of the worker of an earlier service.
pub enum Adoption {
    /// It runs, and this service goes on watching it.
    Running(Box<dyn Worker>),
    /// There is none.
    Gone,
}

/// Memory that a running worker was started with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reservation {
    /// Resident memory that it is forecast to need.
    pub reserved_bytes: u64,
    /// Resident memory that it uses now.
    pub used_bytes: u64,
}

/// What new workers can have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Capacity {
    /// Memory for new workers, in bytes.
    pub memory_bytes: u64,
    /// Number of new workers.
    pub workers: usize,
}
