//! Configuration of the service: flags of the command line, else a TOML file with the same names, else defaults.

mod executor;

pub use executor::{ExecutorChoices, ExecutorError, SlurmConfig};

use crate::access::{AccessRules, AccessSources, SharedAccess, TokenFileError};
use crate::base_path;
use crate::rate_limit::RateLimiter;
use clap::Args;
use meniscus_jobs::service::supervisor::{DISK_RESERVE_BYTES, Settings};
use meniscus_jobs::spec::body::Allowance;
use meniscus_jobs::system::process;
use serde::Deserialize;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::time::Duration;

/// Settings as the operator gives them. None stands for the default.
#[derive(Debug, Clone, Default, Args, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Choices {
    /// Data directory; created if it does not exist.
    #[arg(long)]
    pub data: Option<PathBuf>,
    /// Address or name and port to listen on, 127.0.0.1:8080 by default; port 0 picks a free port. Addresses other than loopback
    /// need tokens.
    #[arg(long)]
    pub bind: Option<String>,
    /// Jobs that run at the same time; cores / threads by default.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1024))]
    pub slots: Option<u64>,
    /// Threads of a job, both default and maximum; cores / slots, or 1, by default.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1024))]
    pub threads: Option<u64>,
    /// File with one token per line: NAME SCOPES sha256:DIGEST (`meniscus token NAME` prints such a line).
    #[arg(long)]
    pub token_file: Option<PathBuf>,
    /// Additional host names under which the service answers, besides localhost and the address it listens on.
    #[arg(long)]
    #[serde(default)]
    pub allow_host: Vec<String>,
    /// Origins whose pages may use the service, such as https://lab.example; none but its own by default.
    #[arg(long)]
    #[serde(default)]
    pub allow_origin: Vec<String>,
    /// Path below which the service answers, such as /meniscus, where a proxy hands on a part of its addresses.
    #[arg(long)]
    pub base_path: Option<String>,
    /// Days after which ended jobs are deleted; never by default.
    #[arg(long)]
    pub retention_days: Option<u32>,
    /// Jobs, studies and uploads that each client may create per minute; unlimited by default.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub creations_per_minute: Option<u32>,
    /// Jobs that may be unfinished at the same time; unlimited by default.
    #[arg(long)]
    pub most_unfinished: Option<u64>,
    /// Largest upload in bytes, 2 GiB by default.
    #[arg(long)]
    pub upload_bytes: Option<u64>,
    /// Disk space in bytes that jobs leave free, 64 MiB by default.
    #[arg(long)]
    pub disk_reserve_bytes: Option<u64>,
    /// Seconds without a heartbeat after which a worker is killed, 30 by default.
    #[arg(long)]
    pub lease_s: Option<u64>,
    /// At a stop, let workers on a cluster write a checkpoint and return to the queue; else they go on.
    #[arg(long)]
    #[serde(default)]
    pub drain: bool,
    /// What runs the jobs; the table `[executor]` of the configuration file.
    #[arg(skip)]
    pub executor: Option<Box<ExecutorChoices>>,
    /// Bring jobs and uploads that a lost or older database does not know back from their own files.
    #[arg(long)]
    #[serde(skip)]
    pub adopt: bool,
    /// Do not measure an unknown machine with a few short runs at the start.
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
    /// Jobs that run at the same time.
    pub slots: usize,
    /// Threads of a job, both default and maximum.
    pub threads: usize,
    /// Tokens, host names and origins.
    pub access: SharedAccess,
    /// File of the tokens.
    pub token_file: Option<PathBuf>,
    /// Path below which the service answers; empty for its whole address.
    pub base_path: String,
    /// Creations of each client per minute.
    pub rate_limiter: RateLimiter,
    /// Days after which ended jobs are deleted; None for never.
    pub retention_days: Option<u32>,
    /// Jobs that may be unfinished at the same time; None for any number.
    pub most_unfinished: Option<u64>,
    /// Largest upload in bytes.
    pub upload_bytes: u64,
    /// Disk space in bytes that jobs leave free.
    pub disk_reserve_bytes: u64,
    /// Time without a heartbeat after which a worker is killed.
    pub lease: Duration,
    /// The cluster that runs the jobs; None where this machine does.
    pub slurm: Option<SlurmConfig>,
    /// Whether what a lost database does not know is brought back.
    pub adopt: bool,
    /// Whether an unknown machine is measured at the start of the service.
    pub calibrate: bool,
}

/// Why a configuration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// Without tokens the service would be open to the network.
    #[error("{0} is not a loopback address: give --token-file (`meniscus token NAME` makes tokens), or bind 127.0.0.1")]
    Public(SocketAddr),
    /// The address cannot be read.
    #[error("--bind {text} cannot be used: {cause}; give ADDRESS:PORT, such as 127.0.0.1:8080 or localhost:8080")]
    Bind {
        /// The address as given.
        text: String,
        /// What is wrong with it.
        cause: String,
    },
    /// The base path cannot be used.
    #[error("{0}")]
    BasePath(String),
    /// The data directory is missing.
    #[error("the data directory is missing: give --data DIR, or `data` in the configuration file")]
    NoData,
    /// The token file cannot be used.
    #[error(transparent)]
    Tokens(#[from] TokenFileError),
    /// The table `[executor]` cannot be used.
    #[error("{0}")]
    Executor(#[from] ExecutorError),
    /// The configuration file cannot be used.
    #[error("{path}: {cause}")]
    File {
        /// Path of the file.
        path: String,
        /// What is wrong with it.
        cause: String,
    },
}

/// Times that a worker on a cluster has to follow a request before it is ended: its files come late.
const CLUSTER_CANCEL_GRACE: Duration = Duration::from_secs(3);
const CLUSTER_PAUSE_GRACE: Duration = Duration::from_secs(60);
/// Default of the largest upload in bytes.
const UPLOAD_BYTES: u64 = 2 << 30;

impl Choices {
    /// Reads settings from a TOML file.
    ///
    /// # Errors
    /// [`ConfigError`].
    pub fn from_file(path: &std::path::Path) -> Result<Self, ConfigError> {
        let wrong = |cause: String| ConfigError::File { path: path.display().to_string(), cause };
        let text = std::fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
        toml::from_str(&text).map_err(|error| wrong(error.to_string()))
    }

    /// These settings, completed by others where they are None.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            data: self.data.or(other.data),
            bind: self.bind.or(other.bind),
            slots: self.slots.or(other.slots),
            threads: self.threads.or(other.threads),
            token_file: self.token_file.or(other.token_file),
            allow_host: if self.allow_host.is_empty() { other.allow_host } else { self.allow_host },
            allow_origin: if self.allow_origin.is_empty() { other.allow_origin } else { self.allow_origin },
            base_path: self.base_path.or(other.base_path),
            retention_days: self.retention_days.or(other.retention_days),
            creations_per_minute: self.creations_per_minute.or(other.creations_per_minute),
            most_unfinished: self.most_unfinished.or(other.most_unfinished),
            upload_bytes: self.upload_bytes.or(other.upload_bytes),
            disk_reserve_bytes: self.disk_reserve_bytes.or(other.disk_reserve_bytes),
            lease_s: self.lease_s.or(other.lease_s),
            drain: self.drain || other.drain,
            executor: self.executor.or(other.executor),
            adopt: self.adopt,
            no_calibration: self.no_calibration || other.no_calibration,
        }
    }
}

/// Access rules from settings. Without tokens only this machine is served.
fn access_rules(choices: &Choices, bind: SocketAddr) -> Result<AccessRules, ConfigError> {
    let sources = AccessSources {
        token_file: choices.token_file.as_deref(),
        hosts: &choices.allow_host,
        origins: &choices.allow_origin,
    };
    let access = AccessRules::new(&sources, bind.ip())?;
    if !bind.ip().is_loopback() && !access.has_tokens() {
        return Err(ConfigError::Public(bind));
    }
    Ok(access)
}

/// The address of a text such as `127.0.0.1:8080` or `localhost:8080`. Of several, an IPv4 address comes first.
fn resolve(text: &str) -> Result<SocketAddr, ConfigError> {
    let wrong = |cause: String| ConfigError::Bind { text: text.to_owned(), cause };
    let found: Vec<SocketAddr> = text.to_socket_addrs().map_err(|error| wrong(error.to_string()))?.collect();
    let first = found.iter().find(|address| address.is_ipv4()).or_else(|| found.first());
    first.copied().ok_or_else(|| wrong("the name has no address".to_owned()))
}

impl Config {
    /// Checks settings and fills in defaults: one thread per job and one job per core.
    ///
    /// # Errors
    /// [`ConfigError`].
    pub fn new(choices: &Choices) -> Result<Self, ConfigError> {
        let bind = choices.bind.as_deref().map_or(Ok(SocketAddr::from(([127, 0, 0, 1], 8080))), resolve)?;
        let access = access_rules(choices, bind)?;
        let small = |number: Option<u64>| number.map(|n| n as usize);
        let (slots, threads) = (small(choices.slots), small(choices.threads));
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = threads.unwrap_or_else(|| slots.map_or(1, |slots| (cores / slots.max(1)).max(1))).max(1);
        let slots = slots.unwrap_or((cores / threads).max(1)).max(1);
        let slurm = choices.executor.as_ref().map(|given| given.slurm(choices.drain)).transpose()?.flatten();
        let (slots, threads) = match &slurm {
            // The cluster's cores are not this machine's.
            Some(slurm) => (slurm.settings.window, small(choices.threads).unwrap_or(1)),
            None => (slots, threads),
        };
        let own_lease = Duration::from_secs(choices.lease_s.unwrap_or(30).max(3));
        Ok(Self {
            data: choices.data.clone().ok_or(ConfigError::NoData)?,
            bind,
            slots,
            threads,
            access: SharedAccess::new(access),
            token_file: choices.token_file.clone(),
            base_path: base_path::parse(choices.base_path.as_deref().unwrap_or_default())
                .map_err(ConfigError::BasePath)?,
            rate_limiter: RateLimiter::new(choices.creations_per_minute),
            retention_days: choices.retention_days,
            most_unfinished: choices.most_unfinished,
            upload_bytes: choices.upload_bytes.unwrap_or(UPLOAD_BYTES),
            disk_reserve_bytes: choices.disk_reserve_bytes.unwrap_or(DISK_RESERVE_BYTES),
            lease: slurm.as_ref().map_or(own_lease, |slurm| slurm.settings.lease),
            slurm,
            adopt: choices.adopt,
            calibrate: !choices.no_calibration,
        })
    }

    /// Reads tokens, host names and origins again. What is wrong leaves the rules as they are.
    ///
    /// # Errors
    /// [`ConfigError`].
    pub fn reload(&self, choices: &Choices) -> Result<(), ConfigError> {
        self.access.replace(access_rules(choices, self.bind)?);
        Ok(())
    }

    /// What a job may ask for: what a node gives, or four fifths of this machine's memory shared among the slots.
    #[must_use]
    pub fn allowance(&self) -> Allowance {
        let memory = process::total_memory().unwrap_or(4 << 30);
        let own = memory / 5 * 4 / self.slots as u64;
        let memory_bytes = self.slurm.as_ref().map_or(own, |slurm| slurm.memory_bytes);
        Allowance { threads: self.threads as u64, memory_bytes, local_files: false }
    }

    /// The supervisor's rules.
    #[must_use]
    pub fn settings(&self) -> Settings {
        // A cluster's window counts its jobs; what may be in line for it is the executor's to say.
        let own = Settings::with_slots(if self.slurm.is_some() { usize::MAX } else { self.slots });
        let (cancel_grace, pause_grace) = match self.slurm {
            Some(_) => (CLUSTER_CANCEL_GRACE, CLUSTER_PAUSE_GRACE),
            None => (own.cancel_grace, own.pause_grace),
        };
        Settings {
            lease: self.lease,
            cancel_grace,
            pause_grace,
            disk_reserve_bytes: self.disk_reserve_bytes,
            retention_days: self.retention_days,
            ..own
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Choices, Config, ConfigError};

    #[test]
    fn flags_override_the_file_and_unknown_names_in_the_file_are_errors() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("config.toml");
        std::fs::write(&path, "data = \"/d\"\nslots = 3\nthreads = 2\nallow-host = [\"a.example\"]\n").unwrap();
        let flags = Choices { slots: Some(1), ..Choices::default() };
        let config = Config::new(&flags.or(Choices::from_file(&path).unwrap())).unwrap();
        assert_eq!((config.slots, config.threads), (1, 2));
        std::fs::write(&path, "slot = 3\n").unwrap();
        assert!(Choices::from_file(&path).unwrap_err().to_string().contains("slot"));
    }

    #[test]
    fn names_are_addresses_too() {
        let bind = |text: &str| {
            let choices = Choices { data: Some("/d".into()), bind: Some(text.to_owned()), ..Choices::default() };
            Config::new(&choices).map(|config| config.bind.to_string()).map_err(|error| error.to_string())
        };
        assert_eq!(bind("localhost:8081").as_deref(), Ok("127.0.0.1:8081"));
        for wrong in ["localhost", "8080", "127.0.0.1:99999"] {
            let said = bind(wrong).unwrap_err();
            assert!(said.contains(wrong) && said.contains("localhost:8080"), "{said}");
        }
    }

    #[test]
    fn nothing_public_without_tokens() {
        let choices = Choices { data: Some("/d".into()), bind: Some("0.0.0.0:80".to_owned()), ..Choices::default() };
        assert!(matches!(Config::new(&choices), Err(ConfigError::Public(_))));
    }

    #[test]
    fn the_sample_configuration_is_one() {
        let sample = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/config.example.toml");
        assert!(Choices::from_file(std::path::Path::new(sample)).is_ok());
        // Everything that is commented out is valid, too.
        let text = std::fs::read_to_string(sample).unwrap();
        let whole: String = text
            .lines()
            .map(|line| line.strip_prefix("# ").filter(|l| l.contains(" = ")).unwrap_or(line))
            .fold(String::new(), |all, line| all + line + "\n");
        let choices: Choices = toml::from_str(&whole).unwrap();
        assert!(choices.token_file.is_some() && choices.most_unfinished.is_some());
    }

    #[test]
    fn the_sample_configuration_of_a_cluster_is_one() {
        let sample = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/slurm/config.toml");
        let text = std::fs::read_to_string(sample).unwrap();
        let whole: String = text
            .lines()
            .map(|line| line.strip_prefix("# ").filter(|l| l.contains(" = ")).unwrap_or(line))
            .fold(String::new(), |all, line| all + line + "\n");
        // This machine has no such path.
        for text in [text, whole].map(|text| text.replace("/shared/meniscus-bin/meniscus", "/bin/true")) {
            let choices: Choices = toml::from_str(&text).unwrap();
            let config = Config::new(&choices).unwrap();
            let slurm = config.slurm.unwrap();
            assert_eq!((config.slots, slurm.settings.options.len()), (200, 2));
        }
    }
}
