//! Holding workers to requests and limits.

use super::Supervisor;
use crate::service::store::{Change, StoreError};
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
    /// Passes on requests, ends workers that do not follow them or gave no sign of life, pauses at limits.
    pub(super) fn hold_to_limits(&mut self, k: usize) -> Result<(), StoreError> {
        let state = self.state_of(&self.running[k].job)?;
        if self.draining && state == Some(State::Running) {
            self.pause(k, Reason::ServerRestart)?;
        }
        let settings = self.settings;
        let running = &mut self.running[k];
        match state {
            Some(State::Canceling) => match running.told_cancel {
                None => {
                    running.worker.say("cancel");
                    running.told_cancel = Some(Instant::now());
                }
                Some(told) if told.elapsed() >= settings.cancel_grace => running.worker.kill(),
                Some(_) => {}
            },
            Some(State::Pausing) => match running.told_pause {
                None => {
                    running.worker.say("pause");
                    running.told_pause = Some(Instant::now());
                }
                Some(told) if told.elapsed() >= settings.pause_grace => running.worker.kill(),
                Some(_) => {}
            },
            // The row is gone or the job is at another attempt: nobody would believe this worker.
            None => running.worker.kill(),
            Some(_) => {}
        }
        if running.worker.silence() >= settings.lease {
            self.store.condemn(&running.job, running.epoch, Reason::WorkerStalled)?;
            running.worker.kill();
        }
        self.watch_memory(k)?;
        self.renew_lease(k)?;
        if state == Some(State::Running) {
            self.watch_time_and_disk(k)?;
        }
        Ok(())
    }

    fn watch_memory(&mut self, k: usize) -> Result<(), StoreError> {
        let running = &mut self.running[k];
        let limit = running.options.limits.memory_bytes;
        if process::resident_bytes(running.worker.pid()).is_some_and(|bytes| bytes > limit) {
            // Written down first: a crash of the service must not turn a limit into bad luck.
            self.store.condemn(&running.job, running.epoch, Reason::LimitMemory)?;
            running.worker.kill();
        }
        Ok(())
    }

    fn renew_lease(&mut self, k: usize) -> Result<(), StoreError> {
        let term = self.settings.lease;
        let running = &mut self.running[k];
        if running.lease_renewed.elapsed() >= term / 3 && running.worker.silence() < term / 3 {
            running.lease_renewed = Instant::now();
            self.store.lease(&running.job, running.epoch, running.worker.pid(), &lease_end(term))?;
        }
        Ok(())
    }

    fn watch_time_and_disk(&mut self, k: usize) -> Result<(), StoreError> {
        let running = &mut self.running[k];
        let wall = running.usage_before.wall_s - running.leg_wall_s + running.began.elapsed().as_secs_f64();
        if running.options.limits.wall_s.is_some_and(|limit| wall >= limit) {
            return self.pause(k, Reason::LimitWalltime);
        }
        if running.disk_checked.elapsed() >= DISK_INTERVAL {
            running.disk_checked = Instant::now();
            if let Some(limit) = running.options.limits.disk_bytes {
                let used = process::directory_bytes(&self.store.job_directory(&running.job));
                if used as f64 > limit {
                    return self.pause(k, Reason::LimitDisk);
                }
            }
        }
        Ok(())
    }

    fn pause(&mut self, k: usize, reason: Reason) -> Result<(), StoreError> {
        let change = Change { reason: Some(reason), message: None, epoch: Some(self.running[k].epoch) };
        let job = self.running[k].job.clone();
        self.store_change(&job, Trigger::Pause, &change)?;
        let running = &mut self.running[k];
        if running.told_pause.is_none() {
            running.worker.say("pause");
            running.told_pause = Some(Instant::now());
        }
        Ok(())
    }

    /// Jobs that rest because the disk was full go on when there is room for a checkpoint and the reserve.
    pub(super) fn resume_when_space_is_back(&mut self) -> Result<(), StoreError> {
        if self.space_checked.elapsed() < SPACE_INTERVAL {
            return Ok(());
        }
        self.space_checked = Instant::now();
        for job in self.store.paused_for(Reason::StorageEnospc)? {
            let needed = job.disk_bytes_to_come().saturating_add(self.settings.disk_reserve_bytes);
            if process::free_space(self.store.directory()).is_some_and(|free| free > needed) {
                self.store_change(&job.id, Trigger::Resume, &Change::default())?;
            }
        }
        Ok(())
    }
}
