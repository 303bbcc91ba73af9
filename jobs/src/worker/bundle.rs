//! The process of a bundle: one job of a cluster that works through a fixed list of short attempts, some at a time. Each attempt has
//! its own directory, claim and worker, as if it were alone; an attempt that was claimed before is passed over.

use super::detached::{self, Terms};
use crate::spec::attempt_files;
use crate::spec::heartbeat::Heartbeat;
use crate::spec::requests::NOT_STARTED_CODE;
use crate::system::process;
use rustix::process::{Pid, Signal, kill_process};
use signal_hook::consts::{SIGTERM, SIGUSR1};
use signal_hook::iterator::Signals;
use std::fs::{self, OpenOptions};
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// What a bundle works through.
#[derive(Debug, Clone)]
pub struct Bundle {
    /// Directories of the attempts, in order.
    pub attempts: Vec<PathBuf>,
    /// What claims the attempts: number and count of restarts of the cluster's job.
    pub owner: String,
    /// Attempts at once.
    pub lanes: usize,
    /// How its workers live.
    pub terms: Terms,
}

/// Exit code of a worker that a signal has ended, as shells have it for SIGKILL.
const KILLED_CODE: i32 = 137;
/// Time between two looks at workers and signals.
const LOOK: Duration = Duration::from_millis(5);

/// Reads the list of a bundle: a directory a line.
///
/// # Errors
/// When it cannot be read.
pub fn read_list(file: &Path) -> io::Result<Vec<PathBuf>> {
    Ok(fs::read_to_string(file)?.lines().map(PathBuf::from).collect())
}

/// Works through a bundle. At the first SIGTERM its workers are told to write their checkpoints, and no other attempt is begun.
///
/// # Errors
/// When signals cannot be received, or this is another program than the one that was ordered.
pub fn run(bundle: &Bundle) -> io::Result<()> {
    // Before anything that takes time: without a listener a signal ends the process.
    let mut signals = Signals::new([SIGTERM, SIGUSR1])?;
    if let Some(cause) = detached::foreign_build(&bundle.terms)? {
        // Each says why it did not begin.
        for attempt in bundle.attempts.iter().filter(|attempt| claim(attempt, &bundle.owner)) {
            say_last(attempt, NOT_STARTED_CODE.into(), Some(cause.clone()));
        }
        return Err(io::Error::other(cause));
    }
    let mut waiting = bundle.attempts.iter();
    let mut workers: Vec<(&PathBuf, Child)> = Vec::new();
    let mut is_over = false;
    loop {
        if signals.pending().any(|signal| signal == SIGTERM) {
            is_over = true;
            workers.iter().filter_map(|(_, worker)| Pid::from_raw(worker.id().cast_signed())).for_each(|pid| {
                // It may have ended in between.
                let _ = kill_process(pid, Signal::TERM);
            });
        }
        let mut left = Vec::new();
        for (attempt, mut worker) in workers {
            match worker.try_wait()? {
                None => left.push((attempt, worker)),
                // It was told to stop before it listened, so it has done nothing.
                Some(status) if is_over && status.signal() == Some(SIGTERM) => {
                    say_last(attempt, NOT_STARTED_CODE.into(), Some("the cluster ended the bundle".to_owned()));
                }
                // No other process sees how it ended.
                Some(status) if !has_said_last(attempt) => {
                    say_last(attempt, status.code().unwrap_or(KILLED_CODE), None);
                }
                Some(_) => {}
            }
        }
        workers = left;
        while !is_over && workers.len() < bundle.lanes.max(1) {
            let Some(attempt) = waiting.next() else { break };
            if claim(attempt, &bundle.owner) {
                workers.extend(start(attempt, &bundle.terms).map(|worker| (attempt, worker)));
            }
        }
        if workers.is_empty() && (is_over || waiting.len() == 0) {
            return Ok(());
        }
        std::thread::sleep(LOOK);
    }
}

/// Claims an attempt; false where it is claimed already, also by the service that took it back.
fn claim(attempt: &Path, owner: &str) -> bool {
    let claim = attempt.join(attempt_files::CLAIM);
    let is_claimed = fs::create_dir(&claim).is_ok();
    if is_claimed {
        // A claim without an owner holds as well.
        let _ = fs::write(claim.join(attempt_files::CLAIM_OWNER), format!("{owner}\n"));
    }
    is_claimed
}

fn has_said_last(attempt: &Path) -> bool {
    Heartbeat::read(attempt).is_some_and(|last| last.exit_code.is_some())
}

/// Says in a worker's place how it ended.
fn say_last(attempt: &Path, exit_code: i32, cause: Option<String>) {
    let before = Heartbeat::read(attempt);
    let count = before.map_or(1, |last| last.count + 1);
    let last = Heartbeat { count, memory_bytes: None, host: process::host_name(), exit_code: Some(exit_code), cause };
    // Without it the attempt is given up when its lease is over.
    let _ = last.write(attempt);
}

/// Starts the worker of an attempt. One that cannot be started says so in its sign of life.
fn start(attempt: &Path, terms: &Terms) -> Option<Child> {
    let log = OpenOptions::new().create(true).append(true).open(attempt.join(attempt_files::LOG));
    let started = log.and_then(|log| {
        Command::new("/proc/self/exe")
            .arg0("meniscus")
            .args(["worker", "--detached", "--heartbeat-s", &terms.heartbeat.as_secs_f64().to_string()])
            .args(["--lease-s", &terms.lease.as_secs_f64().to_string(), "--attempt"])
            .arg(attempt)
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log)
            .spawn()
    });
    match started {
        Ok(worker) => Some(worker),
        Err(error) => {
            say_last(attempt, NOT_STARTED_CODE.into(), Some(error.to_string()));
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{claim, read_list};

    #[test]
    fn an_attempt_is_claimed_once() {
        let directory = tempfile::tempdir().unwrap();
        assert!(claim(directory.path(), "7.0"));
        assert!(!claim(directory.path(), "8.0"));
        assert_eq!(std::fs::read_to_string(directory.path().join("claim/owner")).unwrap(), "7.0\n");
    }

    #[test]
    fn a_list_has_a_directory_a_line() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "/a/b\n/c\n").unwrap();
        assert_eq!(read_list(file.path()).unwrap(), [std::path::PathBuf::from("/a/b"), "/c".into()]);
    }
}
