//! Holding workers to requests and limits.

use super::{Running, Supervisor};
use crate::service::executor::Phase;
use crate::service::store::{Change, StoreError};
use crate::spec::requests::Request;
use crate::spec::states::{Reason, State, Trigger};
use crate::system::process;
use std::time::{Duration, Instant};

/// Time between two looks at the size of a job's files.
const DISK_INTERVAL: Duration = Duration::from_secs(2);
/// Time between two looks whether space is back.
const SPACE_INTERVAL: Duration = Duration::from_secs(2);

/// End of a lease that begins now.
pub(super) fn lease_end(term: Duration) -> String {
    let end = jiff::Timestamp::now() + term;
    format!("{end:.3}")
}

impl Supervisor {
    /// Passes on requests, kills workers that do not follow them or give no sign of life, pauses jobs at their limits.
    pub(super) fn hold_to_limits(&self, running: &mut Running) -> Result<(), StoreError> {
        let state = self.store.state(&running.job)?;
        if self.is_draining() && state == Some(State::Running) && !self.executor.outlives_service() {
            self.pause(running, Reason::ServerRestart)?;
        }
        let settings = self.settings;
        match state {
            Some(State::Canceling) => {
                insist(running, Request::Cancel, settings.cancel_grace, self.clock.now());
            }
            Some(State::Pausing) => insist(running, Request::Pause, settings.pause_grace, self.clock.now()),
            // The row is gone: the records of this worker would not be believed.
            None => running.worker.kill(),
            Some(_) => {}
        }
        if running.worker.phase() == Phase::Running {
            self.watch_heartbeat(running)?;
            self.watch_memory(running)?;
            if state == Some(State::Running) {
                self.watch_time_and_disk(running)?;
            }
            self.renew_lease(running)?;
        }
        Ok(())
    }

    fn watch_heartbeat(&self, running: &mut Running) -> Result<(), StoreError> {
        let now = self.clock.now();
        running.heard = running.heard.max(now.saturating_sub(running.worker.time_since_heartbeat()));
        if now - running.heard >= self.settings.lease {
            self.kill(running, Reason::WorkerStalled)?;
        }
        Ok(())
    }

    fn watch_memory(&self, running: &mut Running) -> Result<(), StoreError> {
        let limit = running.options.limits.memory_bytes;
        if running.worker.usage().memory_bytes.is_some_and(|bytes| bytes > limit) {
            self.kill(running, Reason::LimitMemory)?;
        }
        Ok(())
    }

    /// Kills a worker. The reason is written down first: a crash of the service must not turn a limit into bad luck.
    fn kill(&self, running: &mut Running, reason: Reason) -> Result<(), StoreError> {
        if !running.is_kill_noted {
            self.store.note_kill(&running.job, running.epoch, reason)?;
            running.is_kill_noted = true;
        }
        running.worker.kill();
        Ok(())
    }

    fn renew_lease(&self, running: &mut Running) -> Result<(), StoreError> {
        let term = self.settings.lease;
        if running.lease_renewed.elapsed() >= term / 3 && running.worker.time_since_heartbeat() < term / 3 {
            running.lease_renewed = Instant::now();
            self.store.lease(&running.job, running.epoch, running.worker.handle(), &lease_end(term))?;
        }
        Ok(())
    }

    fn watch_time_and_disk(&self, running: &mut Running) -> Result<(), StoreError> {
        let wall_s = running.usage_before.wall_s - running.leg_wall_s + running.began.elapsed().as_secs_f64();
        if running.options.limits.wall_s.is_some_and(|limit| wall_s >= limit) {
            return self.pause(running, Reason::LimitWalltime);
        }
        if running.disk_checked.elapsed() >= DISK_INTERVAL {
            running.disk_checked = Instant::now();
            if let Some(limit) = running.options.limits.disk_bytes {
                let used = process::directory_bytes(&self.store.job_directory(&running.job));
                if used as f64 > limit {
                    return self.pause(running, Reason::LimitDisk);
                }
            }
        }
        Ok(())
    }

    fn pause(&self, running: &mut Running, reason: Reason) -> Result<(), StoreError> {
        let change = Change { reason: Some(reason), epoch: Some(running.epoch), ..Change::default() };
        self.change(&running.job, Trigger::Pause, &change)?;
        if running.pause_sent.is_none() {
            let is_drained = reason == Reason::ServerRestart;
            running.worker.send(if is_drained { Request::Drain } else { Request::Pause });
            running.pause_sent = Some(self.clock.now());
        }
        Ok(())
    }

    /// Resumes jobs that were paused because the disk was full, when there is space for a checkpoint and the reserve.
    pub(super) fn resume_when_space_is_back(&mut self) -> Result<(), StoreError> {
        if self.space_checked.elapsed() < SPACE_INTERVAL {
            return Ok(());
        }
        self.space_checked = Instant::now();
        for job in self.store.paused_for(Reason::StorageEnospc)? {
            let needed = job.disk_bytes_to_come().saturating_add(self.settings.disk_reserve_bytes);
            if process::free_space(self.store.jobs_directory()).is_some_and(|free| free > needed) {
                self.change(&job.id, Trigger::Resume, &Change::default())?;
            }
        }
        Ok(())
    }
}

/// Sends a request once, and kills a worker that has not followed it in time.
fn insist(running: &mut Running, request: Request, grace: Duration, now: Duration) {
    let sent = if request == Request::Cancel { &mut running.cancel_sent } else { &mut running.pause_sent };
    match sent {
        None => {
            *sent = Some(now);
            running.worker.send(request);
        }
        Some(sent) if now - *sent >= grace => running.worker.kill(),
        Some(_) => {}
    }
}
