//! The supervisor: one thread of the service that starts workers, imports what they say, holds them to their limits
//! and settles how they ended. It also brings unfinished jobs to a legal state when the service starts.

mod leftovers;
mod limits;

use crate::service::executor::{Executor, Worker};
use crate::service::store::import::{Imported, ProgressPace};
use crate::service::store::settle::Loss;
use crate::service::store::{Change, ChangeError, JobRow, START_CHECKPOINT, Store, StoreError};
use crate::spec::attempt_spec::{self, Order, StartCheckpoint, attempt_directory};
use crate::spec::records::Usage;
use crate::spec::run_options::RunOptions;
use crate::spec::states::{Reason, State, Trigger};
use crate::system::breakpoints::pass;
use crate::system::process;
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
    /// A canceled worker that has not gone after so long is ended.
    pub cancel_grace: Duration,
    /// A pausing worker that has not gone after so long is ended.
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
    options: RunOptions,
    pace: ProgressPace,
    began: Instant,
    usage_before: Usage,
    leg_wall_s: f64,
    told_pause: Option<Instant>,
    told_cancel: Option<Instant>,
    /// When its verdict came; the process is to end soon after.
    verdict_since: Option<Instant>,
    /// Memory that it was admitted with.
    memory_bytes: u64,
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
    /// When what is too old was last looked for.
    expired: Option<Instant>,
    /// Whether something failed in this round.
    is_troubled: bool,
    /// No worker is started before this time, after one could not be.
    start_again: Instant,
}

/// Time between two looks at workers without news.
const TICK: Duration = Duration::from_millis(100);
/// Least time between two rounds.
const BREATH: Duration = Duration::from_millis(10);
/// Time that running jobs have to checkpoint at a shutdown.
const DRAIN: Duration = Duration::from_secs(15);
/// Time that a worker has to end after its verdict.
const LAST_WORDS: Duration = Duration::from_secs(5);
/// Free space below which a worker's last words may not have been written.
const ROOM_FOR_A_VERDICT: u64 = 1 << 20;
/// Time without rounds after one in which something failed.
const TROUBLE_PAUSE: Duration = Duration::from_millis(400);
/// Time between two looks for what is kept no longer.
const EXPIRY_INTERVAL: Duration = Duration::from_secs(600);
/// Time without starts after one that failed.
const START_PAUSE: Duration = Duration::from_secs(1);

impl Supervisor {
    /// A supervisor that has done nothing yet.
    #[must_use]
    pub fn new(store: Arc<Store>, executor: Box<dyn Executor>, settings: Settings) -> Self {
        let (sender, receiver) = channel();
        let now = Instant::now();
        Self {
            store,
            executor,
            settings,
            running: Vec::new(),
            sender,
            receiver,
            draining: false,
            space_checked: now,
            expired: None,
            is_troubled: false,
            start_again: now,
        }
    }

    /// How others speak to it.
    #[must_use]
    pub fn handle(&self) -> SupervisorHandle {
        SupervisorHandle { sender: self.sender.clone() }
    }

    /// Brings every job that had a worker to a legal state and names what the database does not know. To be done before the service is
    /// ready. A restart of the service never counts as a death.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn recover(&self) -> Result<(), StoreError> {
        for job in self.store.unfinished_attempts()? {
            self.end_orphan(&job);
            // What the worker managed to say before counts, its verdict above all. Records that cannot be read are as
            // good as none: the job goes on from its last checkpoint.
            let imported = self.store.import(&job.id, job.attempt, &mut ProgressPace::default());
            let cleared = imported.and_then(|_| leftovers::remove(&self.store, &job.id, job.attempt));
            if let Err(error) = cleared {
                tracing::error!(job = job.id, %error, "records could not be imported or leftovers not removed");
            }
            self.store.settle(&job.id, job.attempt, Loss { reason: Reason::ServerRestart, is_death: false })?;
            tracing::info!(job = job.id, attempt = job.attempt, "recovered");
        }
        for path in self.store.unknown_entries()? {
            tracing::warn!(path = %path.display(), "not in the database; left where it is");
        }
        Ok(())
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
            let first = self.receiver.recv_timeout(wait);
            // A thousand submissions in a second are a hundred rounds, not a thousand.
            std::thread::sleep(BREATH);
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
                        if let Some(running) = self.running.iter_mut().find(|r| r.job == job) {
                            running.worker.say("checkpoint");
                        }
                    }
                    Message::Shutdown => {
                        self.draining = true;
                        drain_until = Some(Instant::now() + DRAIN);
                    }
                }
            }
            if let Err(error) = self.tick() {
                tracing::error!(%error, "the supervisor could not finish its round");
                self.is_troubled = true;
            }
            if std::mem::take(&mut self.is_troubled) {
                // What failed once a tenth of a second ago fails again now.
                std::thread::sleep(TROUBLE_PAUSE);
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
            match self.attend(k) {
                Ok(false) => {}
                Ok(true) => ended.push(k),
                // One job's trouble is not another's.
                Err(error) => {
                    tracing::error!(job = self.running[k].job, %error, "a worker could not be attended");
                    self.is_troubled = true;
                }
            }
        }
        for k in ended.into_iter().rev() {
            self.running.swap_remove(k);
        }
        self.store.stop_failed_studies()?;
        self.expire()?;
        if !self.draining && Instant::now() >= self.start_again {
            self.resume_when_space_is_back()?;
            while self.running.len() < self.settings.slots && self.start_next()? {}
        }
        Ok(())
    }

    /// Deletes what is kept no longer, every now and then.
    fn expire(&mut self) -> Result<(), StoreError> {
        if self.expired.is_some_and(|last| last.elapsed() < EXPIRY_INTERVAL) {
            return Ok(());
        }
        self.expired = Some(Instant::now());
        let gone = self.store.expire(self.settings.retention_days)?;
        if gone > 0 {
            // There may be more; workers are attended in between.
            self.expired = None;
            tracing::info!(gone, "jobs were kept long enough and are deleted");
        }
        Ok(())
    }

    /// Looks after one worker; true when it has ended and is settled.
    fn attend(&mut self, k: usize) -> Result<bool, StoreError> {
        let running = &mut self.running[k];
        // The exit is noted before the last import, so that nothing written before it is missed.
        let exit = running.worker.poll()?;
        // Records that cannot be read are as good as none; limits and the end are looked after all the same.
        let imported = self.store.import(&running.job, running.epoch, &mut running.pace).unwrap_or_else(|error| {
            tracing::error!(job = running.job, %error, "records could not be imported");
            Imported { is_whole: false, ..Imported::default() }
        });
        if imported.has_checkpoint {
            self.prune_checkpoints(k)?;
        }
        let running = &mut self.running[k];
        if let Some(exit) = exit {
            // Without room a worker cannot leave a verdict either.
            let is_full = process::free_space(self.store.directory()).is_some_and(|free| free < ROOM_FOR_A_VERDICT);
            let loss = match (exit.out_of_memory, is_full) {
                (true, _) => Loss { reason: Reason::WorkerOom, is_death: true },
                (false, true) => Loss { reason: Reason::StorageEnospc, is_death: false },
                (false, false) => Loss { reason: Reason::WorkerCrash, is_death: true },
            };
            if imported.is_whole {
                leftovers::remove(&self.store, &running.job, running.epoch)?;
            }
            self.book_disk(k)?;
            let running = &self.running[k];
            self.store.settle(&running.job, running.epoch, loss)?;
            tracing::info!(job = running.job, attempt = running.epoch, ?exit, "worker ended");
            return Ok(true);
        }
        if imported.verdict.is_some() {
            running.verdict_since = Some(Instant::now());
        }
        if let Some(since) = running.verdict_since {
            if since.elapsed() >= LAST_WORDS {
                running.worker.kill();
            }
            return Ok(false);
        }
        self.hold_to_limits(k)?;
        Ok(false)
    }

    /// Removes checkpoints beyond those to keep.
    fn prune_checkpoints(&self, k: usize) -> Result<(), StoreError> {
        let running = &self.running[k];
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
    fn book_disk(&self, k: usize) -> Result<(), StoreError> {
        let running = &self.running[k];
        let Some(row) = self.store.job(&running.job)? else { return Ok(()) };
        let disk_bytes = process::directory_bytes(&self.store.job_directory(&running.job));
        self.store.book_usage(&running.job, running.epoch, &Usage { disk_bytes, ..row.usage })
    }

    /// Takes and starts the next job of the queue; false when there is none that fits.
    fn start_next(&mut self) -> Result<bool, StoreError> {
        let free = process::free_space(self.store.directory()).unwrap_or(u64::MAX);
        let room = free.saturating_sub(self.settings.disk_reserve_bytes);
        // Workers that have just started have not taken their memory yet.
        let promised: u64 = self
            .running
            .iter()
            .map(|r| r.memory_bytes.saturating_sub(process::resident_bytes(r.worker.pid()).unwrap_or(0)))
            .sum();
        let available = process::available_memory().unwrap_or(u64::MAX).saturating_sub(promised);
        // A job that alone is too large for this machine was refused at submission; it is not left waiting for ever.
        let is_alone = self.running.is_empty();
        let fits = |memory: u64, disk: u64| disk <= room && (is_alone || memory <= available);
        let Some(job) = self.store.claim(fits)? else { return Ok(false) };
        let Err(error) = self.start(&job) else { return Ok(true) };
        tracing::error!(job = job.id, %error, "a worker could not be started");
        self.start_again = Instant::now() + START_PAUSE;
        if process::is_out_of_space(&error) {
            let change = Change { reason: Some(Reason::StorageEnospc), message: None, epoch: Some(job.attempt) };
            self.store_change(&job.id, Trigger::Pause, &change)?;
        }
        self.store.settle(&job.id, job.attempt, Loss { reason: Reason::StorageIo, is_death: true })?;
        Ok(false)
    }

    fn start(&mut self, job: &JobRow) -> std::io::Result<()> {
        let options = RunOptions::from_resolved(&job.resolved)?;
        let job_directory = self.store.job_directory(&job.id);
        let directory = attempt_directory(&job_directory, job.attempt);
        std::fs::create_dir_all(&directory)?;
        let order = self.order(job).map_err(std::io::Error::other)?;
        crate::system::artifacts::write(&directory.join(attempt_spec::FILE_NAME), &serde_json::to_vec_pretty(&order)?)?;
        let sender = self.sender.clone();
        let news = Box::new(move || {
            let _ = sender.send(Message::News);
        });
        let worker = self.executor.start(&directory, options.limits.memory_bytes, news)?;
        tracing::info!(job = job.id, attempt = job.attempt, pid = worker.pid(), "worker started");
        let now = Instant::now();
        let until = limits::lease_end(self.settings.lease);
        self.store.lease(&job.id, job.attempt, worker.pid(), &until).map_err(std::io::Error::other)?;
        self.running.push(Running {
            job: job.id.clone(),
            epoch: job.attempt,
            worker,
            options,
            pace: ProgressPace::default(),
            began: now,
            usage_before: job.usage,
            leg_wall_s: job.leg_wall_s,
            told_pause: None,
            told_cancel: None,
            verdict_since: None,
            memory_bytes: job.estimate["memory_bytes"].as_u64().unwrap_or(0),
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
            inputs: self.store.inputs(&job.id)?,
            time: serde_json::from_value(job.estimate["time"].clone()).unwrap_or_default(),
            reserve_bytes: self.settings.disk_reserve_bytes,
            usage: job.usage,
        })
    }

    /// Applies a trigger; a job that has moved on in between is no error.
    fn store_change(&self, job: &str, trigger: Trigger, what: &Change) -> Result<(), StoreError> {
        match self.store.change(job, trigger, what) {
            Err(ChangeError::Store(error)) => Err(error),
            Err(error) => {
                tracing::debug!(job, %error, "a change came too late");
                Ok(())
            }
            Ok(_) => Ok(()),
        }
    }

    /// The state of a job as the store has it.
    fn state_of(&self, job: &str) -> Result<Option<State>, StoreError> {
        Ok(self.store.job(job)?.map(|row| row.state))
    }
}

#[cfg(test)]
mod tests;
