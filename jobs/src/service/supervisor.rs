//! The supervisor: one thread of the service that starts workers, imports their records, holds them to their limits and
//! finishes their attempts. It also brings unfinished jobs to a legal state when the service starts.

mod leftovers;
mod limits;
mod patience;
mod recovery;
mod starting;

use crate::service::executor::{EndCause, Eviction, Executor, Orphans, Phase, Worker};
use crate::service::growing_pause::GrowingPause;
use crate::service::refinement;
use crate::service::store::finish_attempt::{LossCause, LossKind};
use crate::service::store::import::{Imported, ProgressPace};
use crate::service::store::{Change, ChangeError, Store, StoreError};
use crate::spec::attempt_files::attempt_directory;
use crate::spec::heartbeat::Heartbeat;
use crate::spec::records::Usage;
use crate::spec::requests::{NOT_STARTED_CODE, Request};
use crate::spec::run_options::RunOptions;
use crate::spec::states::{Reason, Trigger};
use crate::system::breakpoints::pass;
use crate::system::process;
use patience::PatientClock;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// Free space that no job may use up.
pub const DISK_RESERVE_BYTES: u64 = 64 << 20;

/// How the supervisor behaves.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Jobs that run at once.
    pub slots: usize,
    /// Term of a lease: a worker without a sign of life for so long is ended.
    pub lease: Duration,
    /// A canceled worker that has not ended after so long is killed.
    pub cancel_grace: Duration,
    /// A pausing worker that has not ended after so long is killed.
    pub pause_grace: Duration,
    /// Free space that new attempts leave untouched.
    pub disk_reserve_bytes: u64,
    /// Days that ended jobs are kept; None keeps them for ever.
    pub retention_days: Option<u32>,
}

impl Settings {
    /// The rules of the service for a number of slots.
    #[must_use]
    pub fn with_slots(slots: usize) -> Self {
        Self {
            slots,
            lease: Duration::from_secs(30),
            cancel_grace: Duration::from_millis(1200),
            pause_grace: Duration::from_secs(10),
            disk_reserve_bytes: DISK_RESERVE_BYTES,
            retention_days: None,
        }
    }
}

enum Message {
    News,
    Checkpoint(String),
    Shutdown,
}

/// Sends messages to the supervisor's thread.
#[derive(Debug, Clone)]
pub struct SupervisorHandle {
    sender: Sender<Message>,
}

impl SupervisorHandle {
    /// Starts a round now: there may be something to do.
    pub fn wake(&self) {
        // After a shutdown there is no receiver.
        let _ = self.sender.send(Message::News);
    }

    /// Asks the worker of a job for a checkpoint at the end of its step.
    pub fn checkpoint(&self, job: &str) {
        let _ = self.sender.send(Message::Checkpoint(job.to_owned()));
    }

    /// Lets running jobs checkpoint and go back to the queue, then ends.
    pub fn shut_down(&self) {
        let _ = self.sender.send(Message::Shutdown);
    }
}

/// A worker and the attempt that it runs.
struct Running {
    job: String,
    epoch: u64,
    worker: Box<dyn Worker>,
    options: RunOptions,
    pace: ProgressPace,
    began: Instant,
    /// Cost of the job when this service began to watch the worker.
    usage_before: Usage,
    /// Running time of the job at its last resume, in seconds.
    leg_wall_s: f64,
    /// Times of requests and signs of life, by the supervisor's own clock.
    pause_sent: Option<Duration>,
    cancel_sent: Option<Duration>,
    heard: Duration,
    /// Time at which its verdict came; the process is to end soon after.
    verdict_since: Option<Duration>,
    /// Time at which its end was first seen.
    ended: Option<Duration>,
    /// Whether it was noted why it is killed.
    is_kill_noted: bool,
    /// Memory that was reserved for it.
    reserved_bytes: u64,
    disk_checked: Instant,
    lease_renewed: Instant,
    /// What was last known of its executor's queue.
    phase: Phase,
    waits_for: Option<String>,
}

/// The supervisor's state.
pub struct Supervisor {
    store: Arc<Store>,
    executor: Box<dyn Executor>,
    settings: Settings,
    running: Vec<Running>,
    sender: Sender<Message>,
    receiver: Receiver<Message>,
    /// Time at which a shutdown ends even if workers still run; None while there is no shutdown.
    drain_until: Option<Instant>,
    space_checked: Instant,
    /// Last search for jobs that are kept no longer.
    expired: Option<Instant>,
    /// Whether something failed in this round.
    round_failed: bool,
    /// No worker is started for a while after one could not be started.
    start_pause: GrowingPause,
    clock: PatientClock,
    clock_saved: Instant,
    /// Whether an attempt may still have a process though it has ended here.
    orphans: Option<Orphans>,
}

/// Time between two rounds without messages.
const TICK: Duration = Duration::from_millis(100);
/// Least time between two rounds.
const ROUND_INTERVAL: Duration = Duration::from_millis(10);
/// Time that a round spends on starting workers: those that run are to be heard, too.
const START_TIME: Duration = Duration::from_millis(200);
/// Time that running jobs have to checkpoint at a shutdown.
const DRAIN: Duration = Duration::from_secs(15);
/// Time that a worker has to end after its verdict.
const TIME_TO_EXIT: Duration = Duration::from_secs(5);
/// Free space below which a worker may not have been able to write its verdict.
const VERDICT_BYTES: u64 = 1 << 20;
/// Time without rounds after one in which something failed.
const FAILURE_PAUSE: Duration = Duration::from_millis(400);
/// Time between two times at which the clock of the data directory is saved.
const CLOCK_INTERVAL: Duration = Duration::from_secs(60);
/// The hint of a job whose worker could not be started.
fn not_started_hint(cause: &str, pause: Duration) -> String {
    format!(
        "a worker could not be started ({cause}); the queue tries again by itself, next time in {} s",
        pause.as_secs()
    )
}

/// Time between two searches for jobs that are kept no longer.
const EXPIRY_INTERVAL: Duration = Duration::from_secs(600);

impl Supervisor {
    /// A supervisor that has done nothing yet.
    #[must_use]
    pub fn new(store: Arc<Store>, executor: Box<dyn Executor>, settings: Settings) -> Self {
        let (sender, receiver) = channel();
        let now = Instant::now();
        let orphans = executor.orphans();
        if let Some(orphans) = &orphans {
            store.spare_orphans(Arc::clone(orphans));
        }
        Self {
            orphans,
            store,
            executor,
            settings,
            running: Vec::new(),
            sender,
            receiver,
            drain_until: None,
            space_checked: now,
            expired: None,
            round_failed: false,
            start_pause: GrowingPause::default(),
            clock: PatientClock::new(),
            clock_saved: now,
        }
    }

    /// The handle by which other threads send messages.
    #[must_use]
    pub fn handle(&self) -> SupervisorHandle {
        SupervisorHandle { sender: self.sender.clone() }
    }

    /// Works until it is told to shut down.
    pub fn run(mut self) {
        loop {
            self.take_messages();
            if let Err(error) = self.round() {
                tracing::error!(%error, "the supervisor could not finish its round");
                self.round_failed = true;
            }
            if std::mem::take(&mut self.round_failed) {
                // What failed once a tenth of a second ago fails again now.
                std::thread::sleep(FAILURE_PAUSE);
            }
            let may_leave = || self.running.is_empty() || self.executor.outlives_service();
            if self.drain_until.is_some_and(|end| may_leave() || Instant::now() >= end) {
                return;
            }
        }
    }

    /// Waits for messages, at most until the next round is due, and takes all that have come.
    fn take_messages(&mut self) {
        let wait = if self.running.is_empty() { 5 * TICK } else { TICK };
        let first = self.receiver.recv_timeout(wait);
        // A thousand submissions in a second are a hundred rounds, not a thousand.
        std::thread::sleep(ROUND_INTERVAL);
        let mut messages: Vec<Message> = self.receiver.try_iter().collect();
        match first {
            Ok(message) => messages.push(message),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => messages.push(Message::Shutdown),
        }
        for message in messages {
            match message {
                Message::News => {}
                Message::Checkpoint(job) => {
                    if let Some(running) = self.running.iter_mut().find(|running| running.job == job) {
                        running.worker.send(Request::Checkpoint);
                    }
                }
                Message::Shutdown => self.drain_until = Some(Instant::now() + DRAIN),
            }
        }
    }

    /// Whether a shutdown has begun.
    fn is_draining(&self) -> bool {
        self.drain_until.is_some()
    }

    /// One round: import records, hold workers to their limits, finish attempts, let studies refine, start workers.
    fn round(&mut self) -> Result<(), StoreError> {
        self.clock.begin_round();
        for mut running in std::mem::take(&mut self.running) {
            match self.watch(&mut running) {
                Ok(true) => continue,
                Ok(false) => {}
                // A failure of one job is not one of the others.
                Err(error) => {
                    tracing::error!(job = running.job, %error, "a worker could not be watched");
                    self.round_failed = true;
                }
            }
            self.running.push(running);
        }
        self.store.stop_failed_studies()?;
        if !self.is_draining() {
            self.round_failed |= refinement::advance_all(&self.store)? > 0;
        }
        self.expire()?;
        if self.clock_saved.elapsed() >= CLOCK_INTERVAL {
            self.clock_saved = Instant::now();
            self.store.save_clock()?;
        }
        if !self.is_draining() && !self.start_pause.is_on() {
            self.resume_when_space_is_back()?;
            let began = Instant::now();
            while self.running.len() < self.settings.slots && began.elapsed() < START_TIME && self.start_next()? {}
        }
        Ok(())
    }

    /// Deletes, from time to time, jobs that are kept no longer.
    fn expire(&mut self) -> Result<(), StoreError> {
        if self.expired.is_some_and(|last| last.elapsed() < EXPIRY_INTERVAL) {
            return Ok(());
        }
        self.expired = Some(Instant::now());
        self.store.delete_intended()?;
        let gone = self.store.expire(self.settings.retention_days)?;
        if gone > 0 {
            // There may be more; workers are watched in between.
            self.expired = None;
            tracing::info!(gone, "jobs were kept long enough and are deleted");
        }
        Ok(())
    }

    /// Watches one worker; true when it has ended and its attempt is finished.
    fn watch(&mut self, running: &mut Running) -> Result<bool, StoreError> {
        // The end is noted before the last import, so that nothing written before it is missed.
        let end = running.worker.poll()?;
        // Records that cannot be read are as good as none; limits and the end are watched all the same.
        let imported = if running.worker.has_news() || end.is_some() {
            self.store.import(&running.job, running.epoch, &mut running.pace).unwrap_or_else(|error| {
                tracing::error!(job = running.job, %error, "records could not be imported");
                Imported { is_whole: false, ..Imported::default() }
            })
        } else {
            Imported::default()
        };
        if imported.has_checkpoint {
            self.prune_checkpoints(running)?;
        }
        if imported.verdict.is_some() {
            running.verdict_since.get_or_insert(self.clock.now());
        }
        if let Some(cause) = end {
            if self.has_words_to_come(running, cause, imported.is_whole)? {
                return Ok(false);
            }
            self.finish(running, cause, imported.is_whole)?;
            return Ok(true);
        }
        if imported.any {
            self.start_pause.reset();
        }
        self.note_phase(running)?;
        let now = self.clock.now();
        match running.verdict_since {
            Some(since) if now - since >= TIME_TO_EXIT => running.worker.kill(),
            Some(_) => {}
            None => self.hold_to_limits(running)?,
        }
        Ok(false)
    }

    /// Whether a worker that ended in good order has left a verdict that is not seen here yet.
    fn has_words_to_come(&self, running: &mut Running, cause: EndCause, is_whole: bool) -> Result<bool, StoreError> {
        let late = self.executor.late_files();
        if late.is_zero() || cause != (EndCause::Exited { code: 0 }) {
            return Ok(false);
        }
        let has_verdict = is_whole && self.store.job(&running.job)?.is_none_or(|row| row.verdict.is_some());
        let since = *running.ended.get_or_insert(self.clock.now());
        Ok(!has_verdict && self.clock.now() - since < late)
    }

    /// Finishes the attempt of a worker that has ended.
    fn finish(&mut self, running: &Running, cause: EndCause, is_whole: bool) -> Result<(), StoreError> {
        if cause == (EndCause::Exited { code: i32::from(NOT_STARTED_CODE) }) {
            return self.miss(&running.job, running.epoch, "the system did not grant what a worker needs");
        }
        // On a full device a worker cannot leave a verdict either.
        let is_full = process::free_space(self.store.jobs_directory()).is_some_and(|free| free < VERDICT_BYTES);
        let loss = match cause {
            EndCause::OutOfMemory => LossCause::new(Reason::WorkerOom, LossKind::Death),
            EndCause::Evicted(why) => self.eviction(running, why),
            _ if is_full => LossCause::new(Reason::StorageEnospc, LossKind::Harmless),
            EndCause::Exited { .. } | EndCause::Signaled { .. } => LossCause::new(Reason::WorkerCrash, LossKind::Death),
        };
        if is_whole {
            leftovers::remove(&self.store, &running.job, running.epoch, self.orphans.as_ref())?;
        }
        self.book_disk(running)?;
        self.store.finish_attempt(&running.job, running.epoch, &loss)?;
        tracing::info!(job = running.job, attempt = running.epoch, ?cause, "worker ended");
        Ok(())
    }

    /// What an eviction counts as, and what is said about it. What could not begin has not died: the queue tries again after a
    /// pause.
    fn eviction(&mut self, running: &Running, why: Eviction) -> LossCause {
        let last = Heartbeat::read(&attempt_directory(&self.store.job_directory(&running.job), running.epoch));
        let cause = last.and_then(|last| last.cause);
        let message = cause.as_ref().map_or_else(|| why.to_string(), |cause| format!("{why}: {cause}"));
        let (kind, hint) = match why {
            Eviction::NotBegun => {
                let pause = self.start_pause.begin();
                tracing::error!(
                    job = running.job,
                    cause = message,
                    pause_s = pause.as_secs(),
                    "a worker could not be started"
                );
                (LossKind::Harmless, Some(not_started_hint(&message, pause)))
            }
            Eviction::Unreached => (LossKind::Harmless, None),
            _ => (LossKind::Eviction, None),
        };
        LossCause { message: Some(message), hint, ..LossCause::new(Reason::WorkerEvicted, kind) }
    }

    /// Notes what a worker waits for in its executor's queue, and begins to count its time when it begins to work.
    fn note_phase(&self, running: &mut Running) -> Result<(), StoreError> {
        let phase = running.worker.phase();
        if phase == Phase::Running && running.phase == Phase::Waiting {
            (running.began, running.heard) = (Instant::now(), self.clock.now());
        }
        running.phase = phase;
        let waits_for = running.worker.waits_for();
        if waits_for != running.waits_for {
            self.store.note_waiting(&running.job, running.epoch, waits_for.as_deref())?;
            running.waits_for = waits_for;
        }
        Ok(())
    }

    /// Removes checkpoints beyond those to keep.
    fn prune_checkpoints(&self, running: &Running) -> Result<(), StoreError> {
        pass("checkpoint/imported");
        let directory = self.store.job_directory(&running.job);
        for old in self.store.prune_checkpoints(&running.job, running.options.checkpoint.keep as usize)? {
            pass("checkpoint/pruned");
            if let Err(error) = std::fs::remove_file(attempt_directory(&directory, old.attempt).join(&old.path)) {
                tracing::warn!(job = running.job, %error, "an old checkpoint could not be removed");
            }
        }
        Ok(())
    }

    /// Books the size of a job's files.
    fn book_disk(&self, running: &Running) -> Result<(), StoreError> {
        let Some(row) = self.store.job(&running.job)? else { return Ok(()) };
        let disk_bytes = process::directory_bytes(&self.store.job_directory(&running.job));
        self.store.book_usage(&running.job, running.epoch, &Usage { disk_bytes, ..row.usage })
    }

    /// Applies a trigger; a job that has moved on in between is no error.
    fn change(&self, job: &str, trigger: Trigger, change: &Change) -> Result<(), StoreError> {
        match self.store.change(job, trigger, change) {
            Err(ChangeError::Store(error)) => Err(error),
            Err(error) => {
                tracing::debug!(job, %error, "a change came too late");
                Ok(())
            }
            Ok(_) => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
