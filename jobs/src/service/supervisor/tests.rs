//! Limits and losses, with processes that stand in for workers because real ones keep to their limits.

use super::{Settings, Supervisor};
use crate::service::executor::{
    Adoption, AttemptPlace, Capacity, EndCause, Executor, Needs, NotStarted, Notify, Phase, Reservation, Worker,
    WorkerUsage,
};
use crate::service::store::{JobRow, Store, StoreError};
use crate::spec::body::{self, Allowance, NoSources};
use crate::spec::requests::Request;
use crate::spec::states::{Reason, State};
use crate::system::process;
use serde_json::json;
use std::io;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Starts a command instead of a worker, with a fixed time since the last heartbeat.
struct StandIn {
    command: &'static [&'static str],
    time_since_heartbeat: Duration,
}

struct StandInWorker {
    child: Child,
    handle: String,
    time_since_heartbeat: Duration,
}

impl Executor for StandIn {
    fn start(&self, _: &AttemptPlace, _: &Needs, _: Notify) -> Result<Box<dyn Worker>, NotStarted> {
        let child = Command::new(self.command[0])
            .args(&self.command[1..])
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .spawn()?;
        let handle = child.id().to_string();
        Ok(Box::new(StandInWorker { child, handle, time_since_heartbeat: self.time_since_heartbeat }))
    }

    fn adopt(&self, attempt: &AttemptPlace, handle: Option<&str>, needs: &Needs, notify: Notify) -> Adoption {
        // It finds every worker again, as a cluster does.
        assert!(attempt.directory.ends_with("attempts/1") && handle == Some("queued-17"));
        Adoption::Running(self.start(attempt, needs, notify).unwrap())
    }

    fn capacity(&self, _: &[Reservation]) -> Capacity {
        Capacity { memory_bytes: u64::MAX, workers: usize::MAX }
    }
}

impl Worker for StandInWorker {
    fn handle(&self) -> &str {
        &self.handle
    }

    fn send(&mut self, _: Request) {}

    fn time_since_heartbeat(&self) -> Duration {
        self.time_since_heartbeat
    }

    fn phase(&self) -> Phase {
        Phase::Running
    }

    fn usage(&self) -> WorkerUsage {
        WorkerUsage { memory_bytes: process::resident_bytes(self.child.id()) }
    }

    fn poll(&mut self) -> io::Result<Option<EndCause>> {
        let status = self.child.try_wait()?;
        Ok(status.map(|status| match status.signal() {
            Some(signal) => EndCause::Signaled { signal },
            None => EndCause::Exited { code: status.code().unwrap() },
        }))
    }

    fn kill(&mut self) {
        let _ = self.child.kill();
    }
}

fn submit(store: &Store) -> String {
    let spec = json!({"scene": {"kind": "redistance"}, "limits": {"memory_bytes": 64_000_000}});
    let allowance = Allowance { threads: 1, memory_bytes: 1 << 33, local_files: false };
    let body = body::parse(&spec, allowance, &NoSources).ok().unwrap();
    store.submit_row(&body).id
}

fn end_of(stand_in: impl Executor + 'static, until: impl Fn(&JobRow) -> bool) -> JobRow {
    let directory = tempfile::tempdir().unwrap();
    let store = Arc::new(Store::open(directory.path()).unwrap());
    let id = submit(&store);
    let settings = Settings { lease: Duration::from_secs(2), ..Settings::with_slots(1) };
    let supervisor = Supervisor::new(Arc::clone(&store), Box::new(stand_in), settings);
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
    let job = end_of(StandIn { command, time_since_heartbeat: Duration::ZERO }, |job| job.state.is_terminal());
    assert_eq!((job.state, job.reason), (State::Failed, Some(Reason::LimitMemory)));
    assert_eq!(job.attempt, 1);
}

#[test]
fn a_silent_worker_is_ended_and_the_third_fails_the_job() {
    let command = &["sleep", "1000"];
    let job = end_of(StandIn { command, time_since_heartbeat: Duration::from_secs(31) }, |job| job.state.is_terminal());
    assert_eq!((job.state, job.reason, job.attempt), (State::Failed, Some(Reason::WorkerStalled), 3));
}

#[test]
fn a_worker_that_ends_without_a_word_is_lost() {
    let job =
        end_of(StandIn { command: &["true"], time_since_heartbeat: Duration::ZERO }, |job| job.state.is_terminal());
    assert_eq!((job.state, job.reason, job.deaths), (State::Failed, Some(Reason::WorkerCrash), 3));
}

#[test]
fn a_worker_that_outlived_its_service_is_adopted_in_the_same_attempt() {
    let directory = tempfile::tempdir().unwrap();
    let store = Arc::new(Store::open(directory.path()).unwrap());
    let id = submit(&store);
    store.claim(|_, _| true).unwrap();
    store.lease(&id, 1, "queued-17", "2026-11-28T00:00:00.000Z").unwrap();
    let stand_in = StandIn { command: &["sleep", "1000"], time_since_heartbeat: Duration::ZERO };
    let mut supervisor = Supervisor::new(Arc::clone(&store), Box::new(stand_in), Settings::with_slots(1));
    supervisor.recover().unwrap();
    let job = store.job(&id).unwrap().unwrap();
    assert_eq!((job.state, job.attempt, supervisor.running.len()), (State::Running, 1, 1));
    for mut running in supervisor.running {
        running.worker.kill();
    }
}

#[test]
fn a_job_that_cannot_be_read_keeps_no_other_from_its_recovery() {
    let directory = tempfile::tempdir().unwrap();
    let store = Arc::new(Store::open(directory.path()).unwrap());
    let (damaged, sound) = (submit(&store), submit(&store));
    for _ in 0..2 {
        store.claim(|_, _| true).unwrap();
    }
    let damage: Result<(), StoreError> = store.write(|transaction| {
        transaction.execute("UPDATE jobs SET resolved = '{}' WHERE id = ?1", [&damaged])?;
        Ok(())
    });
    damage.unwrap();
    let stand_in = Gone(StandIn { command: &["sleep", "1000"], time_since_heartbeat: Duration::ZERO });
    let mut supervisor = Supervisor::new(Arc::clone(&store), Box::new(stand_in), Settings::with_slots(1));
    supervisor.recover().unwrap();
    for id in [&damaged, &sound] {
        assert_eq!(store.job(id).unwrap().unwrap().state, State::Queued);
    }
}

/// Finds no worker of an earlier service.
struct Gone(StandIn);

impl Executor for Gone {
    fn start(&self, attempt: &AttemptPlace, needs: &Needs, notify: Notify) -> Result<Box<dyn Worker>, NotStarted> {
        self.0.start(attempt, needs, notify)
    }

    fn adopt(&self, _: &AttemptPlace, _: Option<&str>, _: &Needs, _: Notify) -> Adoption {
        Adoption::Gone
    }

    fn capacity(&self, reservations: &[Reservation]) -> Capacity {
        self.0.capacity(reservations)
    }
}

/// Refuses the first starts as a system without descriptors does.
struct Refusing {
    left: AtomicU64,
    then: StandIn,
}

impl Executor for Refusing {
    fn start(&self, attempt: &AttemptPlace, needs: &Needs, notify: Notify) -> Result<Box<dyn Worker>, NotStarted> {
        if self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_ok() {
            return Err(io::Error::from_raw_os_error(libc::EMFILE).into());
        }
        self.then.start(attempt, needs, notify)
    }

    fn adopt(&self, attempt: &AttemptPlace, handle: Option<&str>, needs: &Needs, notify: Notify) -> Adoption {
        self.then.adopt(attempt, handle, needs, notify)
    }

    fn capacity(&self, reservations: &[Reservation]) -> Capacity {
        self.then.capacity(reservations)
    }
}

#[test]
fn a_worker_that_cannot_be_started_has_not_died() {
    let sleeping = || StandIn { command: &["sleep", "1000"], time_since_heartbeat: Duration::ZERO };
    let is_waiting = |job: &JobRow| job.state == State::Queued && job.hint.is_some();
    let job = end_of(Refusing { left: AtomicU64::new(u64::MAX), then: sleeping() }, is_waiting);
    assert_eq!((job.attempt, job.deaths, job.reason), (0, 0, None));
    let hint = job.hint.unwrap();
    assert!(hint.contains("Too many open files") && hint.contains("tries again by itself"), "{hint}");
    let is_running = |job: &JobRow| job.state == State::Running;
    let job = end_of(Refusing { left: AtomicU64::new(2), then: sleeping() }, is_running);
    assert_eq!((job.attempt, job.deaths, job.hint), (1, 0, None));
}

#[test]
fn a_worker_without_threads_has_not_died_either() {
    let command = &["sh", "-c", "exit 75"];
    let stand_in = StandIn { command, time_since_heartbeat: Duration::ZERO };
    let job = end_of(stand_in, |job| job.state == State::Queued && job.hint.is_some());
    assert_eq!((job.attempt, job.deaths), (0, 0));
}
