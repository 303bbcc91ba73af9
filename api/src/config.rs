//! What the operator chose: on the command line, else in a file (TOML) with the same names, else by default.

use crate::access::{AccessRules, TokenFileError};
use clap::Args;
use meniscus_jobs::service::supervisor::{DISK_RESERVE_BYTES, Settings};
use meniscus_jobs::spec::body::Allowance;
use meniscus_jobs::system::process;
use serde::Deserialize;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// The choices of an operator.
#[derive(Debug, Clone, Default, Args, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Choices {
    /// Data directory; made when it is not there.
    #[arg(long)]
    pub data: Option<PathBuf>,
    /// Address to listen on, 127.0.0.1:8080 by default; port 0 picks a free one. Anything but loopback needs tokens.
    #[arg(long)]
    pub bind: Option<SocketAddr>,
    /// Jobs at once; cores / threads when not given.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1024))]
    pub slots: Option<u64>,
    /// Threads of a job, default and most; cores / slots, or 1, when not given.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1024))]
    pub threads: Option<u64>,
    /// File of tokens, a line each: NAME SCOPES sha256:DIGEST (`meniscus token` makes them).
    #[arg(long)]
    pub token_file: Option<PathBuf>,
    /// Names under which the service is reached, beside localhost and the address it listens on.
    #[arg(long)]
    #[serde(default)]
    pub allow_host: Vec<String>,
    /// Days that ended jobs are kept; for ever when not given.
    #[arg(long)]
    pub retention_days: Option<u32>,
    /// Jobs, studies and uploads that one client may make in a minute; any number when not given.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub creations_per_minute: Option<u32>,
    /// Jobs that may be unfinished at once; any number when not given.
    #[arg(long)]
    pub most_unfinished: Option<u64>,
    /// Bytes of an upload at most, 2 GiB by default.
    #[arg(long)]
    pub upload_bytes: Option<u64>,
    /// Free space that jobs leave untouched, 64 MiB by default.
    #[arg(long)]
    pub disk_reserve_bytes: Option<u64>,
    /// Seconds without a sign of life after which a worker is ended, 30 by default.
    #[arg(long)]
    pub lease_s: Option<u64>,
    /// Do not measure this machine with a few short runs when nothing is known of it yet.
    #[arg(long)]
    #[serde(default)]
    pub no_calibration: bool,
}

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
    /// Who may do what.
    pub access: AccessRules,
    /// Days that ended jobs are kept.
    pub retention_days: Option<u32>,
    /// Jobs that may be unfinished at once.
    pub most_unfinished: Option<u64>,
    /// Bytes of an upload.
    pub upload_bytes: u64,
    /// Free space that jobs leave untouched.
    pub disk_reserve_bytes: u64,
    /// Term of a worker's lease.
    pub lease: Duration,
    /// Whether an unknown machine is measured at the start.
    pub calibrate: bool,
}

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// Everybody could do everything.
    #[error("{0} is not a loopback address: give --token-file (`meniscus token NAME` makes tokens), or bind 127.0.0.1")]
    Public(SocketAddr),
    /// No place for anything.
    #[error("the data directory is missing: --data DIR, or data in the configuration file")]
    NoData,
    /// The tokens cannot be used.
    #[error(transparent)]
    Tokens(#[from] TokenFileError),
    /// The configuration file cannot be read.
    #[error("{path}: {cause}")]
    File {
        /// Which.
        path: String,
        /// Why.
        cause: String,
    },
}

/// Bytes of an upload when nothing is said.
const UPLOAD_BYTES: u64 = 2 << 30;

impl Choices {
    /// The choices of a file.
    ///
    /// # Errors
    /// [`ConfigError`].
    pub fn of_file(path: &std::path::Path) -> Result<Self, ConfigError> {
        let wrong = |cause: String| ConfigError::File { path: path.display().to_string(), cause };
        let text = std::fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
        toml::from_str(&text).map_err(|error| wrong(error.to_string()))
    }

    /// These choices, and what they leave open from others.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            data: self.data.or(other.data),
            bind: self.bind.or(other.bind),
            slots: self.slots.or(other.slots),
            threads: self.threads.or(other.threads),
            token_file: self.token_file.or(other.token_file),
            allow_host: if self.allow_host.is_empty() { other.allow_host } else { self.allow_host },
            retention_days: self.retention_days.or(other.retention_days),
            creations_per_minute: self.creations_per_minute.or(other.creations_per_minute),
            most_unfinished: self.most_unfinished.or(other.most_unfinished),
            upload_bytes: self.upload_bytes.or(other.upload_bytes),
            disk_reserve_bytes: self.disk_reserve_bytes.or(other.disk_reserve_bytes),
            lease_s: self.lease_s.or(other.lease_s),
            no_calibration: self.no_calibration || other.no_calibration,
        }
    }
}

impl Config {
    /// Checks an operator's choices; what is left open follows from the cores: one thread a job, a job a core.
    ///
    /// # Errors
    /// [`ConfigError`].
    pub fn new(choices: &Choices) -> Result<Self, ConfigError> {
        let bind = choices.bind.unwrap_or_else(|| SocketAddr::from(([127, 0, 0, 1], 8080)));
        let access = AccessRules::new(
            choices.token_file.as_deref(),
            &choices.allow_host,
            bind.ip(),
            choices.creations_per_minute,
        )?;
        if !bind.ip().is_loopback() && !access.has_tokens() {
            return Err(ConfigError::Public(bind));
        }
        let small = |number: Option<u64>| number.map(|n| n as usize);
        let (slots, threads) = (small(choices.slots), small(choices.threads));
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = threads.unwrap_or_else(|| slots.map_or(1, |slots| (cores / slots.max(1)).max(1))).max(1);
        let slots = slots.unwrap_or((cores / threads).max(1)).max(1);
        Ok(Self {
            data: choices.data.clone().ok_or(ConfigError::NoData)?,
            bind,
            slots,
            threads,
            access,
            retention_days: choices.retention_days,
            most_unfinished: choices.most_unfinished,
            upload_bytes: choices.upload_bytes.unwrap_or(UPLOAD_BYTES),
            disk_reserve_bytes: choices.disk_reserve_bytes.unwrap_or(DISK_RESERVE_BYTES),
            lease: Duration::from_secs(choices.lease_s.unwrap_or(30).max(3)),
            calibrate: !choices.no_calibration,
        })
    }

    /// What a job may ask for: four fifths of the memory shared among the slots.
    #[must_use]
    pub fn allowance(&self) -> Allowance {
        let memory = process::total_memory().unwrap_or(4 << 30);
        Allowance { threads: self.threads as u64, memory_bytes: memory / 5 * 4 / self.slots as u64, local_files: false }
    }

    /// The supervisor's rules.
    #[must_use]
    pub fn settings(&self) -> Settings {
        Settings {
            lease: self.lease,
            disk_reserve_bytes: self.disk_reserve_bytes,
            retention_days: self.retention_days,
            ..Settings::with_slots(self.slots)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Choices, Config, ConfigError};

    #[test]
    fn flags_win_over_the_file_and_slips_in_the_file_are_named() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("config.toml");
        std::fs::write(&path, "data = \"/d\"\nslots = 3\nthreads = 2\nallow-host = [\"a.example\"]\n").unwrap();
        let flags = Choices { slots: Some(1), ..Choices::default() };
        let config = Config::new(&flags.or(Choices::of_file(&path).unwrap())).unwrap();
        assert_eq!((config.slots, config.threads), (1, 2));
        std::fs::write(&path, "slot = 3\n").unwrap();
        assert!(Choices::of_file(&path).unwrap_err().to_string().contains("slot"));
    }

    #[test]
    fn nothing_public_without_tokens() {
        let choices = Choices { data: Some("/d".into()), bind: "0.0.0.0:80".parse().ok(), ..Choices::default() };
        assert!(matches!(Config::new(&choices), Err(ConfigError::Public(_))));
    }

    #[test]
    fn the_sample_configuration_is_one() {
        let sample = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/config.example.toml");
        assert!(Choices::of_file(std::path::Path::new(sample)).is_ok());
        // Everything that is commented out is valid, too.
        let text = std::fs::read_to_string(sample).unwrap();
        let whole: String = text
            .lines()
            .map(|line| line.strip_prefix("# ").filter(|l| l.contains(" = ")).unwrap_or(line))
            .fold(String::new(), |all, line| all + line + "\n");
        let choices: Choices = toml::from_str(&whole).unwrap();
        assert!(choices.token_file.is_some() && choices.most_unfinished.is_some());
    }
}
