//! Recovery when the service starts. A restart of the service never counts as a death of a worker.

use super::starting::needs;
use super::{Supervisor, leftovers};
use crate::service::executor::{Adoption, AttemptPlace};
use crate::service::store::finish_attempt::{LossCause, LossKind};
use crate::service::store::import::ProgressPace;
use crate::service::store::{JobRow, StoreError};
use crate::spec::attempt_files::attempt_directory;
use crate::spec::run_options::RunOptions;
use crate::spec::states::Reason;

impl Supervisor {
    /// Brings every job that had a worker to a legal state, and finishes what a crash cut short. To be done before the
    /// service is ready.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn recover(&mut self) -> Result<(), StoreError> {
        for job in self.store.unfinished_attempts()? {
            if self.adopt(&job)? {
                continue;
            }
            // What the worker wrote before counts, its verdict above all. Records that cannot be read are as good as none:
            // the job goes on from its last checkpoint.
            let imported = self.store.import(&job.id, job.attempt, &mut ProgressPace::default());
            let cleared =
                imported.and_then(|_| leftovers::remove(&self.store, &job.id, job.attempt, self.orphans.as_ref()));
            if let Err(error) = cleared {
                tracing::error!(job = job.id, %error, "records could not be imported or leftovers not removed");
            }
            let lost = LossCause::new(Reason::ServerRestart, LossKind::Harmless);
            self.store.finish_attempt(&job.id, job.attempt, &lost)?;
            tracing::info!(job = job.id, attempt = job.attempt, "recovered");
        }
        self.store.delete_intended()?;
        self.store.write_missing_records()
    }

    /// Takes the worker of an earlier service over; false where there is none.
    fn adopt(&mut self, job: &JobRow) -> Result<bool, StoreError> {
        let directory = attempt_directory(&self.store.job_directory(&job.id), job.attempt);
        let place = AttemptPlace { job: job.id.clone(), epoch: job.attempt, directory };
        // A job that cannot be read fails when it is started again; it must not keep the service from its others.
        let options = RunOptions::from_resolved(&job.resolved).ok();
        let needs = options.as_ref().map(|options| needs(job, options)).unwrap_or_default();
        match self.executor.adopt(&place, job.worker_handle.as_deref(), &needs, self.notify()) {
            Adoption::Gone => Ok(false),
            Adoption::Running(mut worker) => match options.filter(|_| job.state.has_worker()) {
                Some(options) => {
                    tracing::info!(job = job.id, attempt = job.attempt, handle = worker.handle(), "worker adopted");
                    self.keep_watch(job, worker, options);
                    Ok(true)
                }
                // The job is about to go back to the queue already, or cannot be read.
                None => {
                    worker.kill();
                    Ok(false)
                }
            },
        }
    }
}
