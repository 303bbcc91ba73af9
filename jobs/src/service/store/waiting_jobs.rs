//! Jobs that wait for a study of their own: it finds the spacing with which they reach the accuracy that was asked for.
//!
//! Until then such a job has no resolved body. The study is a predecessor of the job, which the queue passes over.

use super::idempotency::{IdempotencyKey, Made, Receipt};
use super::studies::{NewStudy, enter_study};
use super::submission::{NewJob, Place, insert};
use super::transitions::apply;
use super::{Change, ChangeError, JobRow, Store, StoreError, rows};
use crate::spec::states::{Reason, Trigger};
use crate::spec::study::RefinementOutcome;
use meniscus::spec::Word;
use rusqlite::{Transaction, params};

impl Store {
    /// Makes a job together with the study that it waits for.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn submit_with_study(
        &self,
        mut job: NewJob,
        study: &NewStudy,
        key: Option<&IdempotencyKey>,
        receipt: impl FnOnce(JobRow) -> Receipt,
    ) -> Result<Made, StoreError> {
        let study_id = format!("std_{}", self.next_id());
        let (number, clock_s) = self.next_submission();
        let id = format!("job_{number}");
        job.awaits = Some(study_id.clone());
        self.make_once(key, |transaction| {
            enter_study(transaction, (&study_id, 0, self.clock.seconds()), study)?;
            insert(transaction, &Place { id: &id, clock_s }, &job, None)?;
            transaction.execute("UPDATE refinements SET job = ?2 WHERE study = ?1", params![study_id, id])?;
            transaction
                .execute("INSERT INTO dependencies (job, predecessor) VALUES (?1, ?2)", params![id, study_id])?;
            Ok(receipt(rows::job(transaction, &id)?.ok_or(rusqlite::Error::QueryReturnedNoRows)?))
        })
    }

    /// Ends a study and gives the job that waits for it its body; the job may start from now on.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn release_job(&self, study: &str, job: &str, ready: &NewJob, message: &str) -> Result<(), StoreError> {
        self.write(|transaction| {
            end(transaction, study, RefinementOutcome::Tolerance, message)?;
            transaction.execute(
                "UPDATE jobs SET rev = rev + 1, resolved = ?2, estimate = ?3, warnings = ?4, memory_bytes = ?5, disk_bytes = ?6,
                     scene_sha256 = ?7, problem = ?8, spacing = ?9
                 WHERE id = ?1 AND state IN ('queued', 'paused')",
                params![
                    job,
                    ready.resolved,
                    ready.estimate,
                    ready.warnings,
                    i64::try_from(ready.memory_bytes).unwrap_or(i64::MAX),
                    i64::try_from(ready.disk_bytes).unwrap_or(i64::MAX),
                    ready.scene_sha256,
                    ready.problem.as_ref().map(|(problem, _)| problem),
                    ready.problem.as_ref().map(|(_, spacing)| spacing),
                ],
            )?;
            transaction
                .execute("DELETE FROM dependencies WHERE job = ?1 AND predecessor = ?2", params![job, study])?;
            Ok(())
        })
    }

    /// Ends a study that cannot tell the spacing, and the job that waits for it.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn fail_waiting_job(
        &self,
        study: &str,
        job: &str,
        outcome: RefinementOutcome,
        message: &str,
    ) -> Result<(), StoreError> {
        self.write(|transaction| {
            end(transaction, study, outcome, message)?;
            let trigger = if outcome == RefinementOutcome::Canceled { Trigger::Cancel } else { Trigger::Fail };
            let reason = if outcome == RefinementOutcome::Canceled {
                Reason::DependencyFailed
            } else {
                Reason::DivergedUnresolved
            };
            let message = Some(format!("{study} cannot tell a spacing for the accuracy: {message}"));
            match apply(transaction, job, trigger, &Change { message, ..Change::because(reason) }) {
                Err(ChangeError::Store(error)) => Err(error),
                _ => Ok(()),
            }
        })
    }
}

fn end(transaction: &Transaction, study: &str, outcome: RefinementOutcome, message: &str) -> rusqlite::Result<()> {
    transaction.execute(
        "UPDATE refinements SET state = 'ended', outcome = ?2, message = ?3 WHERE study = ?1 AND state <> 'ended'",
        params![study, outcome.word(), message],
    )?;
    Ok(())
}
