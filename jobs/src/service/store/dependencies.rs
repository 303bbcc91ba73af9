//! Jobs that wait for others. A row stands for each job that has not succeeded yet; a job without rows may start.

use super::StoreError;
use super::transitions::{self, Change, ChangeError};
use crate::spec::states::{Reason, State, Trigger};
use rusqlite::{OptionalExtension, Transaction, params};

/// Enters the jobs that a new one waits for. One that has ended otherwise than succeeded in the meantime cancels it.
pub(super) fn enter(transaction: &Transaction, job: &str, predecessors: &[String]) -> Result<(), StoreError> {
    for predecessor in predecessors {
        let word: Option<String> = transaction
            .prepare_cached("SELECT state FROM jobs WHERE id = ?1")?
            .query_row([predecessor], |row| row.get(0))
            .optional()?;
        match word.as_deref().and_then(State::from_word) {
            Some(State::Succeeded) => {}
            Some(state) if !state.is_terminal() => {
                transaction
                    .prepare_cached("INSERT OR IGNORE INTO dependencies (job, predecessor) VALUES (?1, ?2)")?
                    .execute(params![job, predecessor])?;
            }
            _ => {
                if let Err(ChangeError::Store(error)) = give_up(transaction, job, predecessor) {
                    // Other errors say that another of its predecessors has canceled it already.
                    return Err(error);
                }
            }
        }
    }
    Ok(())
}

/// Tells the jobs that wait for one that it has ended.
pub(super) fn settle(transaction: &Transaction, job: &str, state: State) -> Result<(), ChangeError> {
    let waiting: Vec<String> = {
        let mut statement = transaction.prepare_cached("SELECT job FROM dependencies WHERE predecessor = ?1")?;
        let rows = statement.query_map([job], |row| row.get(0))?;
        rows.collect::<Result<_, _>>()?
    };
    if waiting.is_empty() {
        return Ok(());
    }
    transaction.execute("DELETE FROM dependencies WHERE predecessor = ?1", [job])?;
    for dependent in waiting {
        // What clients see of it has changed.
        transaction
            .prepare_cached("UPDATE jobs SET progress_count = progress_count + 1 WHERE id = ?1")?
            .execute([&dependent])?;
        if state != State::Succeeded {
            match give_up(transaction, &dependent, job) {
                // It has ended before.
                Ok(()) | Err(ChangeError::Illegal(..)) => {}
                Err(error) => return Err(error),
            }
        }
    }
    Ok(())
}

/// Cancels a job because one that it waits for has not succeeded.
fn give_up(transaction: &Transaction, job: &str, predecessor: &str) -> Result<(), ChangeError> {
    let message = Some(format!("{predecessor} of `after` has not succeeded"));
    transitions::apply(
        transaction,
        job,
        Trigger::Cancel,
        &Change { message, ..Change::because(Reason::DependencyFailed) },
    )
}
