//! What studies allow their jobs: how many run at once, and whether any starts after a failure.

use rusqlite::{Connection, Transaction};
use std::collections::HashSet;

/// Marks a study of which a point has failed, if it stops at failures; the supervisor cancels the rest. A study that refines ends by
/// itself.
pub(super) fn note_failure(transaction: &Transaction, study: &str) -> rusqlite::Result<()> {
    transaction
        .prepare_cached(
            "UPDATE studies SET stopping = 1 WHERE id = ?1 AND on_failure = 'stop' AND stopping = 0
                 AND NOT EXISTS (SELECT 1 FROM refinements WHERE study = ?1)",
        )?
        .execute([study])
        .map(|_| ())
}

/// Studies of which no queued job may start now: the most that may run at once do, or a point has failed and the rest is
/// to be canceled.
pub(super) fn without_a_free_place(connection: &Connection) -> rusqlite::Result<HashSet<String>> {
    let mut statement = connection.prepare_cached(
        "SELECT id FROM studies WHERE stopping = 1
         UNION
         SELECT s.id FROM studies s JOIN
             (SELECT study, COUNT(*) AS many FROM jobs
              WHERE state IN ('running', 'pausing', 'canceling', 'interrupted') AND study IS NOT NULL GROUP BY study) r
             ON r.study = s.id WHERE r.many >= s.max_parallel",
    )?;
    let rows = statement.query_map([], |row| row.get(0))?;
    rows.collect()
}
