//! What becomes of a job when its worker has ended.

use crate::executor::Exit;
use crate::job::{Reason, State, Trigger};
use crate::process;
use crate::records::{Usage, Verdict};
use crate::store::{Change, ChangeError, JobRow, Store, StoreError};

/// How a worker that left no verdict was lost.
#[derive(Debug, Clone, Copy)]
pub(super) struct Loss {
    pub reason: Reason,
    /// Whether it counts towards the three deaths that fail a job.
    pub is_death: bool,
}

impl Loss {
    pub(super) fn of(exit: Exit, condemned: Option<Reason>) -> Self {
        let reason = condemned.unwrap_or(if exit.out_of_memory { Reason::WorkerOom } else { Reason::WorkerCrash });
        Self { reason, is_death: true }
    }
}

/// Deaths in a row without a new checkpoint that fail a job.
const MOST_DEATHS: u32 = 3;

/// Moves a job whose worker has ended to where its verdict or its loss leads.
pub(super) fn settle(
    store: &Store,
    job: &str,
    epoch: u64,
    verdict: Option<Verdict>,
    lost: Loss,
    draining: bool,
) -> Result<(), StoreError> {
    let Some(row) = store.job(job)?.filter(|row| row.attempt == epoch) else {
        return Ok(());
    };
    let at = |reason: Option<Reason>, message: Option<String>| Change { reason, message, epoch: Some(epoch) };
    if row.state == State::Canceling {
        // Whatever the worker came to, it was canceled before.
        let trigger = if verdict.is_some() { Trigger::Drop } else { Trigger::Lose };
        return change(store, job, trigger, &at(None, None)).map(|_| ());
    }
    if row.state == State::Interrupted {
        return requeue(store, &row);
    }
    match verdict {
        Some(Verdict::Succeeded) => change(store, job, Trigger::Finish, &at(None, None)).map(|_| ()),
        Some(Verdict::Failed { reason, message }) => {
            change(store, job, Trigger::Fail, &at(Some(reason), Some(message))).map(|_| ())
        }
        Some(Verdict::Paused { reason }) => {
            if row.state == State::Running {
                change(store, job, Trigger::Pause, &at(reason.or(Some(Reason::UserPause)), None))?;
            }
            let drained = draining && row.reason == Some(Reason::ServerRestart);
            let trigger = if drained { Trigger::Drain } else { Trigger::Rest };
            change(store, job, trigger, &at(reason, None)).map(|_| ())
        }
        // A worker says "canceled" only when told to; without a cancellation it is as good as lost.
        Some(Verdict::Canceled) | None => lose(store, &row, lost),
    }
}

fn lose(store: &Store, row: &JobRow, lost: Loss) -> Result<(), StoreError> {
    let at =
        |reason: Reason, message: Option<String>| Change { reason: Some(reason), message, epoch: Some(row.attempt) };
    if matches!(lost.reason, Reason::LimitMemory | Reason::WorkerOom) {
        return change(store, &row.id, Trigger::Fail, &at(lost.reason, None)).map(|_| ());
    }
    let was_pausing = row.state == State::Pausing;
    let pause_reason = row.reason;
    let Some(interrupted) = change(store, &row.id, Trigger::Lose, &at(lost.reason, None))? else {
        return Ok(());
    };
    if lost.is_death {
        let deaths = store.count_death(&row.id, row.attempt)?;
        if deaths >= MOST_DEATHS {
            let message = format!("{deaths} workers in a row ended without a new checkpoint");
            return change(store, &row.id, Trigger::Fail, &at(lost.reason, Some(message))).map(|_| ());
        }
    }
    let wants_rest = was_pausing && pause_reason != Some(Reason::ServerRestart);
    requeue(store, &interrupted)?;
    if wants_rest {
        // Who asked for a pause gets one, also when the worker had to be ended for it.
        let change_back = Change { reason: pause_reason, ..Change::default() };
        change(store, &row.id, Trigger::Pause, &change_back)?;
    }
    Ok(())
}

fn requeue(store: &Store, row: &JobRow) -> Result<(), StoreError> {
    let at = Change { reason: row.reason, message: None, epoch: Some(row.attempt) };
    change(store, &row.id, Trigger::Requeue, &at).map(|_| ())
}

/// Applies a trigger; None where the job has moved on in between, which is no error here.
pub(super) fn change(store: &Store, job: &str, trigger: Trigger, what: &Change) -> Result<Option<JobRow>, StoreError> {
    match store.change(job, trigger, what) {
        Ok(row) => Ok(Some(row)),
        Err(ChangeError::Store(error)) => Err(error),
        Err(error) => {
            tracing::debug!(job, %error, "a change came too late");
            Ok(None)
        }
    }
}

/// Books the size of a job's files.
pub(super) fn book_disk(store: &Store, job: &str, epoch: u64) -> Result<(), StoreError> {
    let Some(row) = store.job(job)? else {
        return Ok(());
    };
    let disk_bytes = process::directory_bytes(&store.job_directory(job));
    store.book_usage(job, epoch, &Usage { disk_bytes, ..row.usage })
}
