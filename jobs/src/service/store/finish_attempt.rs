//! The end of an attempt: the next state of a job whose worker has ended. It is read, decided and written in one
//! transaction, so that no request and no crash comes in between.

use super::transitions::apply;
use super::{Change, ChangeError, JobRow, Store, StoreError, rows};
use crate::spec::records::Verdict;
use crate::spec::states::{Reason, State, Trigger};
use rusqlite::Transaction;

/// Why a worker that left no verdict was lost.
#[derive(Debug, Clone)]
pub struct LossCause {
    /// Reason, unless the service noted another one before it killed the worker.
    pub reason: Reason,
    /// What the loss counts as.
    pub kind: LossKind,
    /// What happened, in a sentence.
    pub message: Option<String>,
    /// What a user can do, where it is not the hint of the reason.
    pub hint: Option<String>,
}

/// What the loss of a worker counts as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LossKind {
    /// One of the three deaths in a row that fail a job.
    Death,
    /// One of the five evictions in a row that fail a job.
    Eviction,
    /// Nothing: the job had no part in it.
    Harmless,
}

impl LossCause {
    /// A loss without a message.
    #[must_use]
    pub fn new(reason: Reason, kind: LossKind) -> Self {
        Self { reason, kind, message: None, hint: None }
    }
}

/// Deaths in a row without a new checkpoint that fail a job.
const MOST_DEATHS: u32 = 3;
/// Evictions in a row without a new checkpoint that fail a job.
const MOST_EVICTIONS: u32 = 5;

impl Store {
    /// Moves a job whose worker has ended to the state to which its verdict or its loss leads. A job at another attempt, or
    /// without a worker, is left alone.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn finish_attempt(&self, job: &str, epoch: u64, lost: &LossCause) -> Result<(), StoreError> {
        let finished = self.write(|transaction| {
            let row = rows::job(transaction, job)?.filter(|row| row.attempt == epoch);
            row.map_or(Ok(()), |row| decide(transaction, &row, lost))
        });
        match finished {
            Ok(()) => Ok(()),
            Err(ChangeError::Store(error)) => Err(error),
            Err(error) => {
                // In one transaction the table alone decides, and it has a row for every case below.
                tracing::error!(job, %error, "the end of an attempt has no row in the transition table");
                Ok(())
            }
        }
    }
}

fn decide(transaction: &Transaction, row: &JobRow, lost: &LossCause) -> Result<(), ChangeError> {
    let step = |trigger: Trigger, reason: Option<Reason>, message: Option<String>| {
        apply(transaction, &row.id, trigger, &Change { reason, message, epoch: Some(row.attempt), ..Change::default() })
    };
    match row.state {
        // The cancellation came first, whatever the verdict is.
        State::Canceling if row.verdict.is_some() => step(Trigger::Drop, None, None).map(|_| ()),
        State::Canceling => step(Trigger::Lose, None, None).map(|_| ()),
        State::Interrupted => step(Trigger::Requeue, row.reason, None).map(|_| ()),
        State::Running | State::Pausing => match row.verdict.clone() {
            Some(Verdict::Succeeded) => step(Trigger::Finish, None, None).map(|_| ()),
            Some(Verdict::Failed { reason, message }) => step(Trigger::Fail, Some(reason), Some(message)).map(|_| ()),
            Some(Verdict::Paused { reason }) => {
                let mut why = row.reason;
                if row.state == State::Running {
                    why = reason.or(Some(Reason::UserPause));
                    step(Trigger::Pause, why, None)?;
                }
                // A pause on request is kept; after a drain or a limit the reason of the verdict is the newer one.
                let is_drain =
                    |reason: Option<Reason>| matches!(reason, Some(Reason::ServerRestart | Reason::WorkerEvicted));
                let drained = is_drain(why) && (reason.is_none() || is_drain(reason));
                if drained && reason == Some(Reason::WorkerEvicted) {
                    let evictions = count_loss(transaction, row, LossKind::Eviction)?;
                    if evictions >= MOST_EVICTIONS {
                        let message = Some(too_many(evictions, LossKind::Eviction));
                        return step(Trigger::Fail, reason, message).map(|_| ());
                    }
                }
                // A node that is taken back while a limit pauses the job changes nothing about the limit.
                let is_kept = why == Some(Reason::UserPause) || reason == Some(Reason::WorkerEvicted);
                let kept = if is_kept && why.is_some() { why } else { reason.or(why) };
                step(if drained { Trigger::Drain } else { Trigger::Rest }, kept, None).map(|_| ())
            }
            // A worker ends as canceled on request only; without a request it counts as lost.
            Some(Verdict::Canceled | Verdict::Unstarted { .. }) | None => lose(transaction, row, lost),
        },
        _ => Ok(()),
    }
}

fn lose(transaction: &Transaction, row: &JobRow, lost: &LossCause) -> Result<(), ChangeError> {
    let reason = row.kill_reason.unwrap_or(lost.reason);
    let step = |trigger: Trigger, reason: Reason, message: Option<String>| {
        let change = Change { reason: Some(reason), message, epoch: Some(row.attempt), ..Change::default() };
        apply(transaction, &row.id, trigger, &change)
    };
    if matches!(reason, Reason::LimitMemory | Reason::WorkerOom) {
        return step(Trigger::Fail, reason, None).map(|_| ());
    }
    if reason == Reason::StorageEnospc {
        // The job is paused until there is space; a pause on request is kept.
        let kept = row.reason.filter(|asked| *asked == Reason::UserPause).unwrap_or(reason);
        step(Trigger::Lose, kept, None)?;
        step(Trigger::Requeue, kept, None)?;
        return step(Trigger::Pause, kept, None).map(|_| ());
    }
    // A worker that was killed because it did not pause in time has not died by itself.
    let was_pausing = row.state == State::Pausing;
    let reason = if was_pausing { row.reason.unwrap_or(reason) } else { reason };
    step(Trigger::Lose, reason, None)?;
    if !was_pausing {
        let count = count_loss(transaction, row, lost.kind)?;
        let most = match lost.kind {
            LossKind::Death => MOST_DEATHS,
            LossKind::Eviction => MOST_EVICTIONS,
            LossKind::Harmless => u32::MAX,
        };
        if count >= most {
            return step(Trigger::Fail, reason, Some(too_many(count, lost.kind))).map(|_| ());
        }
    }
    let change = Change {
        reason: Some(reason),
        message: lost.message.clone(),
        hint: lost.hint.clone(),
        epoch: Some(row.attempt),
    };
    apply(transaction, &row.id, Trigger::Requeue, &change)?;
    if was_pausing && reason != Reason::ServerRestart {
        step(Trigger::Pause, reason, None)?;
    }
    Ok(())
}

fn too_many(count: u32, kind: LossKind) -> String {
    match kind {
        LossKind::Eviction => format!("the cluster took {count} workers in a row away without a new checkpoint"),
        _ => format!("{count} workers in a row ended without a new checkpoint"),
    }
}

/// Counts a loss of a kind; the number in a row without a new checkpoint.
fn count_loss(transaction: &Transaction, row: &JobRow, kind: LossKind) -> Result<u32, ChangeError> {
    let column = match kind {
        LossKind::Death => "deaths",
        LossKind::Eviction => "evictions",
        LossKind::Harmless => return Ok(0),
    };
    transaction.execute(
        "UPDATE jobs SET deaths = CASE WHEN checkpoint_since THEN 0 ELSE deaths END,
             evictions = CASE WHEN checkpoint_since THEN 0 ELSE evictions END, checkpoint_since = 0 WHERE id = ?1",
        [&row.id],
    )?;
    // The loss right after a new checkpoint begins a new row.
    let counted = if row.has_new_checkpoint { 0 } else { 1 };
    transaction.execute(
        &format!("UPDATE jobs SET {column} = {column} + ?2 WHERE id = ?1"),
        rusqlite::params![row.id, counted],
    )?;
    let count =
        transaction.query_row(&format!("SELECT {column} FROM jobs WHERE id = ?1"), [&row.id], |row| row.get(0))?;
    Ok(count)
}
