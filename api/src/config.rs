//! What the operator chose, with defaults from the machine.

use meniscus_jobs::body::Allowance;
use meniscus_jobs::process;
use std::net::SocketAddr;
use std::path::PathBuf;

/// A service's configuration.
#[derive(Debug, Clone)]
pub struct Config {
    /// Data directory.
    pub data: PathBuf,
    /// Address to listen on.
    pub bind: SocketAddr,
    /// Jobs at once.
    pub slots: usize,
    /// Threads per job, default and most.
    pub threads: usize,
}

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// This version has no authentication.
    #[error(
        "{0} is not a loopback address, and this version has no authentication: bind 127.0.0.1 or [::1] and put a proxy in front"
    )]
    NotLoopback(SocketAddr),
}

impl Config {
    /// Checks an operator's choice; what is not given follows from the cores: one thread a job, a job a core.
    ///
    /// # Errors
    /// [`ConfigError`].
    pub fn new(
        data: PathBuf,
        bind: SocketAddr,
        slots: Option<usize>,
        threads: Option<usize>,
    ) -> Result<Self, ConfigError> {
        if !bind.ip().is_loopback() {
            return Err(ConfigError::NotLoopback(bind));
        }
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = threads.unwrap_or_else(|| slots.map_or(1, |slots| (cores / slots.max(1)).max(1))).max(1);
        let slots = slots.unwrap_or((cores / threads).max(1)).max(1);
        Ok(Self { data, bind, slots, threads })
    }

    /// What a job may ask for: four fifths of the memory shared among the slots.
    #[must_use]
    pub fn allowance(&self) -> Allowance {
        let memory = process::total_memory().unwrap_or(4 << 30);
        Allowance { threads: self.threads as u64, memory_bytes: memory / 5 * 4 / self.slots as u64, local_files: false }
    }
}
