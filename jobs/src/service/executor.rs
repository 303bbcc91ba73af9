//! Executors start workers and know whether they live. [`local`] starts child processes of the service; a cluster's queue is
//! another implementation of the same traits.
//!
//! The supervisor knows a worker by its handle, a text that the executor gives and that the store keeps. What a handle
//! means, where the program lies and how much memory there is belongs to the executor.

mod cgroup;
pub mod local;

use crate::spec::requests::Request;
use crate::system::process;
use std::io;
use std::path::Path;
use std::time::Duration;

/// What an attempt needs of the machine that it runs on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Needs {
    /// Resident memory at most, in bytes.
    pub memory_bytes: u64,
    /// Threads of the worker.
    pub threads: u64,
    /// Running time at most, in seconds.
    pub wall_s: Option<f64>,
}

/// Called, from any thread, when a worker may have written something or has ended.
pub type Notify = Box<dyn Fn() + Send>;

/// Starts workers and finds those of an earlier service again.
pub trait Executor: Send {
    /// Starts a worker for the attempt specification in a directory. Never blocks: an executor with a queue hands over to it.
    ///
    /// # Errors
    /// [`NotStarted`].
    fn start(&self, attempt_directory: &Path, needs: &Needs, notify: Notify) -> Result<Box<dyn Worker>, NotStarted>;

    /// Looks for the worker that an earlier service started under a handle. A worker that cannot be taken over is ended.
    fn adopt(&self, attempt_directory: &Path, handle: &str, notify: Notify) -> Adoption;

    /// What new workers can have beside those that run.
    fn capacity(&self, reservations: &[Reservation]) -> Capacity;
}

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
}
