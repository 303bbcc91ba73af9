//! The table `[executor]` of the configuration file: what runs the jobs.

use meniscus_jobs::service::executor::slurm::{Settings, SettingsError};
use serde::Deserialize;
use std::path::PathBuf;
use std::time::Duration;

/// What runs jobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ExecutorKind {
    /// This machine.
    #[default]
    Local,
    /// A Slurm cluster.
    Slurm,
}

/// The table as the operator gives it. None stands for the default.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct ExecutorChoices {
    /// `local` or `slurm`.
    pub kind: ExecutorKind,
    /// Directory for jobs and uploads that every node sees under this path.
    pub shared: Option<PathBuf>,
    /// The program on every node; the path of this one by default.
    pub program: Option<PathBuf>,
    /// Directory of `sbatch`, `squeue` and `scancel`; they are looked for as usual by default.
    pub commands: Option<PathBuf>,
    /// Options of `sbatch` that the site needs.
    pub options: Vec<String>,
    /// Jobs that the cluster has at once, waiting ones included; 200 by default.
    pub slots: Option<usize>,
    /// Short attempts that a bundle works on at once; 1 by default.
    pub lanes: Option<usize>,
    /// Memory of a job, both default and maximum, in bytes; 4 GiB by default.
    #[serde(alias = "memory_bytes")]
    pub memory_bytes: Option<u64>,
    /// Seconds between two looks at the cluster's table; 30 by default.
    #[serde(alias = "poll_s")]
    pub poll_s: Option<f64>,
    /// Seconds between two submissions; .5 by default.
    #[serde(alias = "submission_interval_s")]
    pub submission_interval_s: Option<f64>,
    /// Seconds that a file may take from a node to this machine; 90 by default.
    #[serde(alias = "settle_grace_s")]
    pub settle_grace_s: Option<f64>,
    /// Seconds between two signs of life of a worker; 15 by default.
    #[serde(alias = "heartbeat_s")]
    pub heartbeat_s: Option<f64>,
    /// Seconds without one after which a worker is given up; 180 by default.
    #[serde(alias = "lease_s")]
    pub lease_s: Option<f64>,
    /// The cluster's limit of time in seconds; that of the partition by default.
    #[serde(alias = "time_limit", alias = "time_limit_s")]
    pub time_limit_s: Option<f64>,
    /// Seconds before the limit at which a worker writes its checkpoint; 60 by default.
    #[serde(alias = "grace_s")]
    pub grace_s: Option<f64>,
}

/// A cluster that runs the jobs.
#[derive(Debug, Clone)]
pub struct SlurmConfig {
    /// How it is used.
    pub settings: Settings,
    /// Directory for jobs and uploads.
    pub shared: PathBuf,
    /// Memory of a job, in bytes.
    pub memory_bytes: u64,
}

/// Why the table cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ExecutorError {
    /// The nodes would not see the jobs.
    #[error("executor.shared is missing: give a directory that every node of the cluster sees under the same path")]
    NoShared,
    /// Something that belongs to a cluster stands in the table of this machine.
    #[error("executor.{0} belongs to executor.kind = \"slurm\"")]
    NotOfThisMachine(&'static str),
    /// A time is none.
    #[error("executor.{name} = {given} cannot be used: {cause}")]
    Time {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        given: f64,
        /// What is wrong with it.
        cause: String,
    },
    /// The cluster cannot be used so.
    #[error(transparent)]
    Settings(#[from] SettingsError),
}

/// Memory of a job by default.
const MEMORY_BYTES: u64 = 4 << 30;
/// Time between the start of a job and the signal before its limit, in seconds.
const LEAST_WORK_S: f64 = 5.0;
/// Signs of life that a lease must outlast.
const HEARTBEATS: f64 = 2.0;

/// A time of the table, at least so many seconds.
fn time(name: &'static str, given: Option<f64>, default: Duration, least: f64) -> Result<Duration, ExecutorError> {
    let Some(given) = given else { return Ok(default) };
    let wrong = |cause: String| ExecutorError::Time { name, given, cause };
    let read = Duration::try_from_secs_f64(given).map_err(|error| wrong(error.to_string()))?;
    if given < least {
        return Err(wrong(format!("the least is {least} s")));
    }
    Ok(read)
}

impl ExecutorChoices {
    /// The cluster that the table describes; None for this machine.
    ///
    /// # Errors
    /// [`ExecutorError`].
    pub fn slurm(&self, drains: bool) -> Result<Option<SlurmConfig>, ExecutorError> {
        if self.kind == ExecutorKind::Local {
            let given = [
                ("shared", self.shared.is_some()),
                ("options", !self.options.is_empty()),
                ("slots", self.slots.is_some()),
            ];
            return match given.iter().find(|(_, is_given)| *is_given) {
                Some((name, _)) => Err(ExecutorError::NotOfThisMachine(name)),
                None => Ok(None),
            };
        }
        let shared = self.shared.clone().ok_or(ExecutorError::NoShared)?;
        let program = match &self.program {
            Some(program) => program.clone(),
            None => std::env::current_exe()
                .map_err(|error| SettingsError::Program { path: PathBuf::from("/proc/self/exe"), error })?,
        };
        let default = Settings::for_program(&program)?;
        let heartbeat = time("heartbeat-s", self.heartbeat_s, default.heartbeat, 0.1)?;
        let late_files = time("settle-grace-s", self.settle_grace_s, default.late_files, 0.0)?;
        let least_lease = HEARTBEATS * heartbeat.as_secs_f64() + late_files.as_secs_f64();
        let grace = time("grace-s", self.grace_s, default.grace, 1.0)?;
        // A job must have time to work before it is told to stop.
        let least_limit = grace.as_secs_f64() + LEAST_WORK_S;
        let limit = self.time_limit_s.map(|given| time("time-limit-s", Some(given), Duration::ZERO, least_limit));
        let settings = Settings {
            commands: self.commands.clone(),
            options: self.options.clone(),
            window: self.slots.unwrap_or(default.window).max(1),
            lanes: self.lanes.unwrap_or(default.lanes).max(1),
            poll: time("poll-s", self.poll_s, default.poll, 0.1)?,
            submission_interval: time(
                "submission-interval-s",
                self.submission_interval_s,
                default.submission_interval,
                0.0,
            )?,
            late_files,
            heartbeat,
            lease: time("lease-s", self.lease_s, default.lease, least_lease)?,
            time_limit: limit.transpose()?,
            grace,
            drains,
            ..default
        };
        let memory_bytes = self.memory_bytes.unwrap_or(MEMORY_BYTES).max(1 << 20);
        Ok(Some(SlurmConfig { settings, shared, memory_bytes }))
    }
}

#[cfg(test)]
mod tests {
    use super::ExecutorChoices;
    use std::time::Duration;

    fn read(text: &str) -> Result<Option<super::SlurmConfig>, String> {
        let choices: ExecutorChoices = toml::from_str(text).map_err(|error| error.to_string())?;
        choices.slurm(false).map_err(|error| error.to_string())
    }

    #[test]
    fn names_may_have_either_dash() {
        let text = "kind = \"slurm\"\nshared = \"/s\"\nprogram = \"/bin/true\"\npoll_s = 5\nlease-s = 300\noptions = [\"--partition=a\"]";
        let slurm = read(text).unwrap().unwrap();
        assert_eq!((slurm.settings.poll, slurm.settings.lease), (Duration::from_secs(5), Duration::from_secs(300)));
        assert_eq!((slurm.settings.window, slurm.settings.options.len()), (200, 1));
        assert!(read("").unwrap().is_none());
    }

    #[test]
    fn what_cannot_work_is_refused_with_what_would() {
        for (text, part) in [
            ("kind = \"slurm\"", "executor.shared"),
            ("shared = \"/s\"", "kind"),
            ("kind = \"slurm\"\nshared = \"/s\"\nlease_s = 30", "least is 120"),
            ("kind = \"slurm\"\nshared = \"/s\"\npoll_s = -1", "poll-s"),
            ("kind = \"slurm\"\nshared = \"/s\"\nprogram = \"/no/such\"", "/no/such"),
            ("kind = \"pbs\"", "pbs"),
            ("polls = 3", "polls"),
        ] {
            let said = read(text).unwrap_err();
            assert!(said.contains(part), "{text}: {said}");
        }
    }
}
