//! The supervisor: one thread of the service that starts workers, imports what they say, holds them to their limits
//! and settles how they ended. It also brings unfinished jobs to a legal state when the service starts.

mod limits;
mod settle;

use crate::body::Wishes;
use crate::executor::{Executor, Worker};
use crate::job::{Reason, State, Trigger};
use crate::order::{self, Order, StartCheckpoint, attempt_directory};
use crate::process;
use crate::records::Usage;
use crate::store::import::ProgressPace;
use crate::store::{Change, JobRow, START_CHECKPOINT, Store, StoreError};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// How the supervisor behaves.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Jobs that run at once.
    pub slots: usize,
    /// A worker without a sign of life for so long is ended.
    pub stall: Duration,
    /// A canceled worker that has not gone after so long is ended.
    pub cancel_grace: Duration,
    /// A pausing worker that has not gone after so long is ended.
    pub pause_grace: Duration,
    /// Free space that new attempts leave untouched.
    pub disk_reserve_bytes: u64,
}

impl Settings {
    /// The rules of the service for a number of slots.
    #[must_use]
    pub fn with_slots(slots: usize) -> Self {
        Self {
            slots,
            stall: Duration::from_secs(30),
            cancel_grace: Duration::from_millis(1200),
            pause_grace: Duration::from_secs(10),
            disk_reserve_bytes: 64 << 20,
        }
    }
}

enum Message {
    News,
    Checkpoint(String),
    Shutdown,
}

/// Speaks to the supervisor's thread.
#[derive(Debug, Clone)]
pub struct SupervisorHandle {
    sender: Sender<Message>,
}

impl SupervisorHandle {
    /// There is something to do.
    pub fn wake(&self) {
        // After a shutdown there is nobody to wake.
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

/// A worker and what is known of it.
struct Running {
    job: String,
    epoch: u64,
    worker: Box<dyn Worker>,
    wishes: Wishes,
    pace: ProgressPace,
    began: Instant,
    usage_before: Usage,
    leg_wall_s: f64,
    told_pause: Option<Instant>,
    told_cancel: Option<Instant>,
    /// Why it was ended by us, written down before the end.
    condemned: Option<Reason>,
    disk_checked: Instant,
    lease_renewed: Instant,
}

/// The supervisor's state.
pub struct Supervisor {
    store: Arc<Store>,
    executor: Box<dyn Executor>,
    settings: Settings,
    running: Vec<Running>,
    sender: Sender<Message>,
    receiver: Receiver<Message>,
    draining: bool,
    space_checked: Instant,
}

/// Time between two looks at workers without news.
const TICK: Duration = Duration::from_millis(100);
/// Time that running jobs have to checkpoint at a shutdown.
const DRAIN: Duration = Duration::from_secs(15);
/// Term of a lease.
const LEASE: Duration = Duration::from_secs(30);

impl Supervisor {
    /// A supervisor that has done nothing yet.
    #[must_use]
    pub fn new(store: Arc<Store>, executor: Box<dyn Executor>, settings: Settings) -> Self {
        let (sender, receiver) = channel();
        let space_checked = Instant::now();
        Self { store, executor, settings, running: Vec::new(), sender, receiver, draining: false, space_checked }
    }

    /// How others speak to it.
    #[must_use]
    pub fn handle(&self) -> SupervisorHandle {
        SupervisorHandle { sender: self.sender.clone() }
    }

    /// Brings every job that had a worker to a legal state and sweeps leftovers. To be done before the service is
    /// ready. A restart of the service never counts as a death.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn recover(&self) -> Result<(), StoreError> {
        for job in self.store.unfinished_attempts()? {
            self.end_orphan(&job);
            // What the worker managed to say before counts, its verdict above all.
            let imported = self.store.import(&job.id, job.attempt, &mut ProgressPace::default())?;
            let lost = settle::Loss { reason: Reason::ServerRestart, is_death: false };
            settle::settle(&self.store, &job.id, job.attempt, imported.verdict, lost, false)?;
            tracing::info!(job = job.id, attempt = job.attempt, "recovered");
        }
        self.store.sweep()
    }

    /// Ends a worker that outlived its service. It could not be believed any more, but it would use the machine.
    fn end_orphan(&self, job: &JobRow) {
        let Some(pid) = job.worker_pid else { return };
        let directory = attempt_directory(&self.store.job_directory(&job.id), job.attempt);
        let command = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        let wanted = directory.as_os_str().as_encoded_bytes();
        let is_ours = command.windows(wanted.len().max(1)).any(|window| window == wanted);
        if is_ours && let Some(pid) = rustix::process::Pid::from_raw(pid.cast_signed()) {
            // It may have gone by itself in between.
            let _ = rustix::process::kill_process(pid, rustix::process::Signal::KILL);
        }
    }

    /// Works until it is told to shut down.
    pub fn run(mut self) {
        let mut drain_until = None;
        loop {
            let wait = if self.running.is_empty() { 5 * TICK } else { TICK };
            match self.receiver.recv_timeout(wait) {
                Ok(Message::News) | Err(RecvTimeoutError::Timeout) => {}
                Ok(Message::Checkpoint(job)) => {
                    if let Some(running) = self.running.iter_mut().find(|r| r.job == job) {
                        running.worker.say("checkpoint");
                    }
                }
                Ok(Message::Shutdown) | Err(RecvTimeoutError::Disconnected) => {
                    self.draining = true;
                    drain_until = Some(Instant::now() + DRAIN);
                }
            }
            if let Err(error) = self.tick() {
                tracing::error!(%error, "the supervisor could not finish its round");
            }
            if self.draining && (self.running.is_empty() || drain_until.is_some_and(|end| Instant::now() >= end)) {
                return;
            }
        }
    }

    /// One round: hear, hold to limits, settle, start.
    fn tick(&mut self) -> Result<(), StoreError> {
        let mut ended = Vec::new();
        for k in 0..self.running.len() {
            if self.attend(k)? {
                ended.push(k);
            }
        }
        for k in ended.into_iter().rev() {
            self.running.swap_remove(k);
        }
        if !self.draining {
            self.resume_when_space_is_back()?;
            while self.running.len() < self.settings.slots && self.start_next()? {}
        }
        Ok(())
    }

    /// Looks after one worker; true when it has ended and is settled.
    fn attend(&mut self, k: usize) -> Result<bool, StoreError> {
        let running = &mut self.running[k];
        // The exit is noted before the last import, so that nothing written before it is missed.
        let exit = running.worker.poll()?;
        let imported = self.store.import(&running.job, running.epoch, &mut running.pace)?;
        if imported.has_checkpoint {
            let directory = self.store.job_directory(&running.job);
            for old in self.store.prune_checkpoints(&running.job, running.wishes.checkpoint.keep as usize)? {
                let path = attempt_directory(&directory, old.attempt).join(&old.path);
                if let Err(error) = std::fs::remove_file(&path) {
                    tracing::warn!(job = running.job, %error, "an old checkpoint could not be removed");
                }
            }
        }
        if let Some(exit) = exit {
            // A verdict may have come with an earlier import and still be unsettled: the worker's last word is kept.
            let lost = settle::Loss::of(exit, running.condemned);
            settle::book_disk(&self.store, &running.job, running.epoch)?;
            settle::settle(&self.store, &running.job, running.epoch, imported.verdict, lost, self.draining)?;
            tracing::info!(job = running.job, attempt = running.epoch, ?exit, "worker ended");
            return Ok(true);
        }
        if imported.verdict.is_some() {
            // The process is about to end; until then the offset must not hide the verdict from the settling import.
            let verdict = imported.verdict;
            let patience = Instant::now();
            while running.worker.poll()?.is_none() && patience.elapsed() < Duration::from_secs(5) {
                std::thread::sleep(Duration::from_millis(2));
            }
            running.worker.kill();
            let lost = settle::Loss { reason: Reason::WorkerCrash, is_death: true };
            settle::book_disk(&self.store, &running.job, running.epoch)?;
            settle::settle(&self.store, &running.job, running.epoch, verdict, lost, self.draining)?;
            return Ok(true);
        }
        self.hold_to_limits(k)?;
        Ok(false)
    }

    /// Takes and starts the next job of the queue; false when there is none that fits.
    fn start_next(&mut self) -> Result<bool, StoreError> {
        let free = process::free_space(self.store.directory()).unwrap_or(u64::MAX);
        if free < self.settings.disk_reserve_bytes {
            return Ok(false);
        }
        let available = process::available_memory().unwrap_or(u64::MAX);
        let is_alone = self.running.is_empty();
        // A job that alone is too large for this machine was refused at submission; it is not left waiting for ever.
        let Some(job) = self.store.claim(|needed| is_alone || needed <= available)? else {
            return Ok(false);
        };
        if let Err(error) = self.start(&job) {
            tracing::error!(job = job.id, %error, "a worker could not be started");
            let reason = if process::is_out_of_space(&error) { Reason::StorageEnospc } else { Reason::StorageIo };
            if reason == Reason::StorageEnospc {
                self.store_change(&job.id, Trigger::Pause, &Change::because(reason))?;
                self.store_change(&job.id, Trigger::Rest, &Change::because(reason))?;
            } else {
                let change =
                    Change { reason: Some(reason), message: Some(error.to_string()), epoch: Some(job.attempt) };
                self.store_change(&job.id, Trigger::Fail, &change)?;
            }
        }
        Ok(true)
    }

    fn start(&mut self, job: &JobRow) -> std::io::Result<()> {
        let wishes = Wishes::of(&job.resolved)?;
        let job_directory = self.store.job_directory(&job.id);
        let directory = attempt_directory(&job_directory, job.attempt);
        std::fs::create_dir_all(&directory)?;
        let order = self.order(job).map_err(std::io::Error::other)?;
        crate::artifacts::write(&directory.join(order::FILE_NAME), &serde_json::to_vec_pretty(&order)?)?;
        let sender = self.sender.clone();
        let news = Box::new(move || {
            let _ = sender.send(Message::News);
        });
        let worker = self.executor.start(&directory, wishes.limits.memory_bytes, news)?;
        tracing::info!(job = job.id, attempt = job.attempt, pid = worker.pid(), "worker started");
        let now = Instant::now();
        let until = limits::lease_end();
        self.store.lease(&job.id, job.attempt, worker.pid(), &until).map_err(std::io::Error::other)?;
        self.running.push(Running {
            job: job.id.clone(),
            epoch: job.attempt,
            worker,
            wishes,
            pace: ProgressPace::default(),
            began: now,
            usage_before: job.usage,
            leg_wall_s: job.leg_wall_s,
            told_pause: None,
            told_cancel: None,
            condemned: None,
            disk_checked: now,
            lease_renewed: now,
        });
        Ok(())
    }

    /// What the worker needs to know: the job's own checkpoints newest first, then the one it was made from.
    fn order(&self, job: &JobRow) -> Result<Order, StoreError> {
        let job_directory = self.store.job_directory(&job.id);
        let allow_other_isa = job.spec["restart"]["allow_other_isa"] == true;
        let mut checkpoints: Vec<StartCheckpoint> = self
            .store
            .checkpoints(&job.id)?
            .into_iter()
            .map(|row| StartCheckpoint {
                path: attempt_directory(&job_directory, row.attempt).join(&row.path),
                id: row.id,
                sha256: Some(row.sha256),
                is_own: true,
                allow_other_isa: false,
            })
            .collect();
        if let Some(id) = &job.restarted_from {
            checkpoints.push(StartCheckpoint {
                id: id.clone(),
                path: job_directory.join(START_CHECKPOINT),
                sha256: job.restart_sha256.clone(),
                is_own: false,
                allow_other_isa,
            });
        }
        Ok(Order {
            job: job.id.clone(),
            epoch: job.attempt,
            body: job.resolved.clone(),
            attempts_directory: job_directory.join("attempts"),
            checkpoints,
            may_start_afresh: job.restarted_from.is_none(),
            usage: job.usage,
        })
    }

    /// Applies a trigger; a job that has moved on in between is no error.
    fn store_change(&self, job: &str, trigger: Trigger, change: &Change) -> Result<(), StoreError> {
        settle::change(&self.store, job, trigger, change).map(|_| ())
    }

    /// The state of a job as the store has it.
    fn state_of(&self, job: &str) -> Result<Option<State>, StoreError> {
        Ok(self.store.job(job)?.map(|row| row.state))
    }
}

#[cfg(test)]
mod tests;
