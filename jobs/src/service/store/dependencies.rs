//! Jobs that wait for others. A row stands for each job that has not succeeded yet; a job without rows may start.

use crate::spec::states::State;
use rusqlite::{OptionalExtension, Transaction, params};

/// Enters the jobs that a new one waits for. The answer is one that has ended otherwise than succeeded in the meantime.
pub(super) fn enter(transaction: &Transaction, job: &str, predecessors: &[String]) -> rusqlite::Result<Option<String>> {
    let mut lost = None;
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
            _ => lost = Some(predecessor.clone()),
        }
    }
    Ok(lost)
}

/// Takes a job that has ended from those that wait for it, which are the answer.
pub(super) fn release(transaction: &Transaction, job: &str) -> rusqlite::Result<Vec<String>> {
    let waiting: Vec<String> = {
        let mut statement = transaction.prepare_cached("SELECT job FROM dependencies WHERE predecessor = ?1")?;
        let rows = statement.query_map([job], |row| row.get(0))?;
        rows.collect::<Result<_, _>>()?
    };
    if !waiting.is_empty() {
        transaction.execute("DELETE FROM dependencies WHERE predecessor = ?1", [job])?;
    }
    for dependent in &waiting {
        // What clients see of it has changed.
        transaction
            .prepare_cached("UPDATE jobs SET progress_count = progress_count + 1 WHERE id = ?1")?
            .execute([dependent])?;
    }
    Ok(waiting)
}
