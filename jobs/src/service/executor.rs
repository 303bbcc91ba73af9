//! Where workers run. `local` starts child processes; a cluster would be another implementation.

pub mod cgroup;
pub mod local;

use std::io;
use std::path::Path;
use std::time::Duration;

/// Starts workers.
pub trait Executor: Send {
    /// Starts a worker for the order in an attempt's directory. `news` is called, from any thread, when it may have
    /// written something.
    ///
    /// # Errors
    /// When it cannot be started.
    fn start(
        &self,
        attempt_directory: &Path,
        memory_bytes: u64,
        news: Box<dyn Fn() + Send>,
    ) -> io::Result<Box<dyn Worker>>;
}

/// How a worker's process ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exit {
    /// Exit code, where it ended by itself.
    pub code: Option<i32>,
    /// Signal, where one ended it.
    pub signal: Option<i32>,
    /// Whether the kernel ended it for lack of memory.
    pub out_of_memory: bool,
}

/// A running worker.
pub trait Worker: Send {
    /// Its process.
    fn pid(&self) -> u32;

    /// Sends a request: `pause`, `cancel`, `checkpoint`.
    fn say(&mut self, word: &str);

    /// Time since its last sign of life.
    fn silence(&self) -> Duration;

    /// How it ended, once it has.
    ///
    /// # Errors
    /// When the system does not tell.
    fn poll(&mut self) -> io::Result<Option<Exit>>;

    /// Ends it at once.
    fn kill(&mut self);
}
