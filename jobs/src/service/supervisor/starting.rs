//! Starting workers: which job is next, what its attempt needs, and the specification that its worker reads.

use super::{Message, Running, Supervisor, limits, not_started_hint};
use crate::service::executor::{AttemptPlace, Needs, NotStarted, Notify, Phase, Reservation, Worker};
use crate::service::store::import::ProgressPace;
use crate::service::store::{Change, JobRow, START_CHECKPOINT, StoreError};
use crate::spec::attempt_files::{self, attempt_directory};
use crate::spec::attempt_spec::{AttemptSpec, StartCheckpoint, Submission};
use crate::spec::run_options::RunOptions;
use crate::spec::states::{Reason, Trigger};
use crate::system::{artifacts, process};
use serde::Deserialize;
use std::io;
use std::time::Instant;

impl Supervisor {
    /// Takes and starts the next job of the queue; false when there is none that fits.
    pub(super) fn start_next(&mut self) -> Result<bool, StoreError> {
        let free = process::free_space(self.store.jobs_directory()).unwrap_or(u64::MAX);
        let disk_left = free.saturating_sub(self.settings.disk_reserve_bytes);
        let capacity = self.executor.capacity(&self.reservations());
        if capacity.workers == 0 {
            return Ok(false);
        }
        // A job that alone is too large for this machine was refused at submission; it is not left waiting for ever.
        let is_alone = self.running.is_empty();
        let fits = |memory: u64, disk: u64| disk <= disk_left && (is_alone || memory <= capacity.memory_bytes);
        let Some(job) = self.store.claim(fits)? else { return Ok(false) };
        let Err(error) = self.start(&job) else { return Ok(true) };
        match &error {
            NotStarted::Unreadable(cause) => {
                tracing::error!(job = job.id, cause, "a job of the store cannot be read");
                let message = Some(format!("the stored body cannot be read: {cause}"));
                let change = Change { reason: Some(Reason::Internal), message, ..Change::default() };
                self.change(&job.id, Trigger::Fail, &change)?;
            }
            NotStarted::NoCheckpoint => {
                let change = Change::because(Reason::CheckpointNoneValid);
                self.change(&job.id, Trigger::Fail, &change)?;
            }
            NotStarted::OutOfSpace(_) => {
                tracing::error!(job = job.id, %error, "a worker could not be started");
                self.change(&job.id, Trigger::Pause, &Change::because(Reason::StorageEnospc))?;
                self.change(&job.id, Trigger::Miss, &Change::because(Reason::StorageEnospc))?;
            }
            NotStarted::System(cause) => self.miss(&job.id, job.attempt, &cause.to_string())?,
        }
        Ok(false)
    }

    /// Sends a job whose worker could not be started back to the queue, which pauses for a while. Nothing has died.
    pub(super) fn miss(&mut self, job: &str, epoch: u64, cause: &str) -> Result<(), StoreError> {
        let pause = self.start_pause.begin();
        tracing::error!(job, cause, pause_s = pause.as_secs(), "a worker could not be started");
        let hint = Some(not_started_hint(cause, pause));
        self.change(job, Trigger::Miss, &Change { hint, epoch: Some(epoch), ..Change::default() })
    }

    fn reservations(&self) -> Vec<Reservation> {
        let reservation = |running: &Running| Reservation {
            reserved_bytes: running.reserved_bytes,
            used_bytes: running.worker.usage().memory_bytes.unwrap_or(0),
        };
        self.running.iter().map(reservation).collect()
    }

    fn start(&mut self, job: &JobRow) -> Result<(), NotStarted> {
        let options =
            RunOptions::from_resolved(&job.resolved).map_err(|error| NotStarted::Unreadable(error.to_string()))?;
        let directory = attempt_directory(&self.store.job_directory(&job.id), job.attempt);
        // A worker of this attempt that was ended while it was being started may have written records.
        if directory.join(attempt_files::RECORDS).exists() {
            std::fs::remove_dir_all(&directory)?;
        }
        std::fs::create_dir_all(&directory)?;
        let job = &self.store.take_last_checkpoint(job).map_err(|error| match error {
            StoreError::CheckpointGone => NotStarted::NoCheckpoint,
            error => NotStarted::System(io::Error::other(error)),
        })?;
        let spec = self.attempt_spec(job).map_err(io::Error::other)?;
        let text = serde_json::to_vec_pretty(&spec).map_err(io::Error::from)?;
        artifacts::write(&directory.join(attempt_files::ATTEMPT_SPEC), &text)?;
        let place = AttemptPlace { job: job.id.clone(), epoch: job.attempt, directory };
        let worker = self.executor.start(&place, &needs(job, &options), self.notify())?;
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
            heard: self.clock.now(),
            verdict_since: None,
            ended: None,
            is_kill_noted: false,
            reserved_bytes: job.forecast.memory_bytes,
            disk_checked: now,
            lease_renewed: now,
            phase: Phase::Running,
            waits_for: None,
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
            late_files_s: self.executor.late_files().as_secs_f64(),
            usage: job.usage,
            submission: Some(Submission {
                spec: job.spec.clone(),
                forecast: job.forecast.clone(),
                warnings: job.warnings.clone(),
                created_at: Some(job.created_at.clone()),
                started_at: job.started_at.clone(),
                owner: job.owner.clone(),
                study: job.study.clone().zip(job.study_index),
                retry_of: job.retry_of.clone(),
            }),
        })
    }
}

/// What an attempt of a job needs.
pub(super) fn needs(job: &JobRow, options: &RunOptions) -> Needs {
    let limits = &options.limits;
    let forecast_s = job.forecast.time.as_ref().map(|time| time.wall_s);
    Needs { memory_bytes: limits.memory_bytes, threads: limits.threads, wall_s: limits.wall_s, forecast_s }
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
