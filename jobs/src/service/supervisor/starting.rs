//! Starting workers: which job is next, what its attempt needs, and the specification that its worker reads.

use super::{Message, Running, Supervisor, limits};
use crate::service::executor::{Needs, NotStarted, Notify, Reservation, Worker};
use crate::service::store::finish_attempt::LossCause;
use crate::service::store::import::ProgressPace;
use crate::service::store::{Change, JobRow, START_CHECKPOINT, StoreError};
use crate::spec::attempt_files::{self, attempt_directory};
use crate::spec::attempt_spec::{AttemptSpec, StartCheckpoint};
use crate::spec::run_options::RunOptions;
use crate::spec::states::{Reason, Trigger};
use crate::system::{artifacts, process};
use serde::Deserialize;
use std::io;
use std::time::{Duration, Instant};

/// Time without starts after one that failed.
const START_PAUSE: Duration = Duration::from_secs(1);

impl Supervisor {
    /// Takes and starts the next job of the queue; false when there is none that fits.
    pub(super) fn start_next(&mut self) -> Result<bool, StoreError> {
        let free = process::free_space(self.store.directory()).unwrap_or(u64::MAX);
        let disk_left = free.saturating_sub(self.settings.disk_reserve_bytes);
        let capacity = self.executor.capacity(&self.reservations());
        // A job that alone is too large for this machine was refused at submission; it is not left waiting for ever.
        let is_alone = self.running.is_empty();
        let fits = |memory: u64, disk: u64| disk <= disk_left && (is_alone || memory <= capacity.memory_bytes);
        let Some(job) = self.store.claim(fits)? else { return Ok(false) };
        let Err(error) = self.start(&job) else { return Ok(true) };
        tracing::error!(job = job.id, %error, "a worker could not be started");
        self.start_again = Instant::now() + START_PAUSE;
        if let NotStarted::OutOfSpace(_) = error {
            let change = Change { reason: Some(Reason::StorageEnospc), message: None, epoch: Some(job.attempt) };
            self.change(&job.id, Trigger::Pause, &change)?;
        }
        let lost = LossCause { reason: Reason::StorageIo, is_death: true };
        self.store.finish_attempt(&job.id, job.attempt, lost)?;
        Ok(false)
    }

    fn reservations(&self) -> Vec<Reservation> {
        let reservation = |running: &Running| Reservation {
            reserved_bytes: running.reserved_bytes,
            used_bytes: running.worker.usage().memory_bytes.unwrap_or(0),
        };
        self.running.iter().map(reservation).collect()
    }

    fn start(&mut self, job: &JobRow) -> Result<(), NotStarted> {
        let options = RunOptions::from_resolved(&job.resolved).map_err(io::Error::from)?;
        let directory = attempt_directory(&self.store.job_directory(&job.id), job.attempt);
        std::fs::create_dir_all(&directory)?;
        let spec = self.attempt_spec(job).map_err(io::Error::other)?;
        let text = serde_json::to_vec_pretty(&spec).map_err(io::Error::from)?;
        artifacts::write(&directory.join(attempt_files::ATTEMPT_SPEC), &text)?;
        let limits = &options.limits;
        let needs = Needs { memory_bytes: limits.memory_bytes, threads: limits.threads, wall_s: limits.wall_s };
        let worker = self.executor.start(&directory, &needs, self.notify())?;
        tracing::info!(job = job.id, attempt = job.attempt, handle = worker.handle(), "worker started");
        let until = limits::lease_end(self.settings.lease);
        self.store.lease(&job.id, job.attempt, worker.handle(), &until).map_err(io::Error::other)?;
        self.keep_watch(job, worker, options);
        Ok(())
    }

    /// What an executor calls when a worker has news.
    pub(super) fn notify(&self) -> Notify {
        let sender = self.sender.clone();
        Box::new(move || {
            // After a shutdown there is no receiver.
            let _ = sender.send(Message::News);
        })
    }

    /// Watches a worker from now on.
    pub(super) fn keep_watch(&mut self, job: &JobRow, worker: Box<dyn Worker>, options: RunOptions) {
        let now = Instant::now();
        self.running.push(Running {
            job: job.id.clone(),
            epoch: job.attempt,
            worker,
            options,
            pace: ProgressPace::default(),
            began: now,
            usage_before: job.usage,
            leg_wall_s: job.leg_wall_s,
            pause_sent: None,
            cancel_sent: None,
            verdict_since: None,
            reserved_bytes: job.forecast.memory_bytes,
            disk_checked: now,
            lease_renewed: now,
        });
    }

    /// What the worker needs to know: the job's own checkpoints newest first, then the one that the job was made from.
    fn attempt_spec(&self, job: &JobRow) -> Result<AttemptSpec, StoreError> {
        let job_directory = self.store.job_directory(&job.id);
        let own = self.store.checkpoints(&job.id)?.into_iter().map(|row| StartCheckpoint {
            path: attempt_directory(&job_directory, row.attempt).join(&row.path),
            id: row.id,
            sha256: Some(row.sha256),
            is_own: true,
            allow_other_isa: false,
        });
        let origin = job.restarted_from.as_ref().map(|id| StartCheckpoint {
            id: id.clone(),
            path: job_directory.join(START_CHECKPOINT),
            sha256: job.restart_sha256.clone(),
            is_own: false,
            allow_other_isa: allows_other_isa(job),
        });
        Ok(AttemptSpec {
            job: job.id.clone(),
            epoch: job.attempt,
            body: job.resolved.clone(),
            attempts_directory: job_directory.join("attempts"),
            checkpoints: own.chain(origin).collect(),
            may_start_afresh: job.restarted_from.is_none(),
            inputs: self.store.inputs(&job.id)?,
            time: job.forecast.time.clone(),
            reserve_bytes: self.settings.disk_reserve_bytes,
            usage: job.usage,
        })
    }
}

/// The part of a body as sent that says whether a restart may compute on another instruction set.
#[derive(Deserialize)]
struct SentBody {
    restart: Option<SentRestart>,
}

#[derive(Deserialize)]
struct SentRestart {
    allow_other_isa: Option<bool>,
}

fn allows_other_isa(job: &JobRow) -> bool {
    let sent = SentBody::deserialize(&job.spec).ok();
    sent.and_then(|body| body.restart?.allow_other_isa).unwrap_or(false)
}
