//! Limits and losses, with processes that stand in for workers because real ones keep to their limits.

use super::{Settings, Supervisor};
use crate::service::executor::{Executor, Exit, Worker};
use crate::service::store::{JobRow, Store};
use crate::spec::body::{self, Allowance, NoSources};
use crate::spec::states::{Reason, State};
use serde_json::json;
use std::io;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Starts a command instead of a worker, with a fixed silence.
struct StandIn {
    command: &'static [&'static str],
    silence: Duration,
}

struct StandInWorker {
    child: Child,
    silence: Duration,
}

impl Executor for StandIn {
    fn start(&self, _: &Path, _: u64, _: Box<dyn Fn() + Send>) -> io::Result<Box<dyn Worker>> {
        let child = Command::new(self.command[0])
            .args(&self.command[1..])
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .spawn()?;
        Ok(Box::new(StandInWorker { child, silence: self.silence }))
    }
}

impl Worker for StandInWorker {
    fn pid(&self) -> u32 {
        self.child.id()
    }

    fn say(&mut self, _: &str) {}

    fn silence(&self) -> Duration {
        self.silence
    }

    fn poll(&mut self) -> io::Result<Option<Exit>> {
        let status = self.child.try_wait()?;
        Ok(status.map(|s| Exit { code: s.code(), signal: s.signal(), out_of_memory: false }))
    }

    fn kill(&mut self) {
        let _ = self.child.kill();
    }
}

fn end_of(stand_in: StandIn, until: impl Fn(&JobRow) -> bool) -> JobRow {
    let directory = tempfile::tempdir().unwrap();
    let store = Arc::new(Store::open(directory.path()).unwrap());
    let spec = json!({"scene": {"kind": "redistance"}, "limits": {"memory_bytes": 64_000_000}});
    let body = body::parse(&spec, Allowance { threads: 1, memory_bytes: 1 << 33, local_files: false }, &NoSources)
        .ok()
        .unwrap();
    let id = store.submit_row(&body).id;
    let supervisor = Supervisor::new(Arc::clone(&store), Box::new(stand_in), Settings::with_slots(1));
    let handle = supervisor.handle();
    let thread = std::thread::spawn(move || supervisor.run());
    let deadline = Instant::now() + Duration::from_secs(20);
    loop {
        let job = store.job(&id).unwrap().unwrap();
        if until(&job) {
            handle.shut_down();
            thread.join().unwrap();
            return job;
        }
        assert!(Instant::now() < deadline, "{job:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_worker_above_its_memory_is_ended_with_the_reason() {
    // dd holds one block of 256 MB.
    let command = &["dd", "if=/dev/zero", "of=/dev/null", "bs=256M", "count=100000"];
    let job = end_of(StandIn { command, silence: Duration::ZERO }, |job| job.state.is_terminal());
    assert_eq!((job.state, job.reason), (State::Failed, Some(Reason::LimitMemory)));
    assert_eq!(job.attempt, 1);
}

#[test]
fn a_silent_worker_is_ended_and_the_third_fails_the_job() {
    let command = &["sleep", "1000"];
    let job = end_of(StandIn { command, silence: Duration::from_secs(31) }, |job| job.state.is_terminal());
    assert_eq!((job.state, job.reason, job.attempt), (State::Failed, Some(Reason::WorkerStalled), 3));
}

#[test]
fn a_worker_that_ends_without_a_word_is_lost() {
    let job = end_of(StandIn { command: &["true"], silence: Duration::ZERO }, |job| job.state.is_terminal());
    assert_eq!((job.state, job.reason, job.deaths), (State::Failed, Some(Reason::WorkerCrash), 3));
}
