//! Events: what happened to a job, numbered from 1 without gaps.

use super::{Store, StoreError};
use rusqlite::{Transaction, params};
use serde_json::Value;

/// One event.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Number within the job.
    pub id: u64,
    /// `state`, `progress`, `checkpoint`, `frame`, `warning`, `finding`.
    pub kind: String,
    /// When.
    pub at: String,
    /// Attempt.
    pub attempt: u64,
    /// Particulars.
    pub data: Value,
}

pub(super) fn append(
    transaction: &Transaction,
    job: &str,
    attempt: u64,
    kind: &str,
    data: &Value,
) -> Result<(), rusqlite::Error> {
    transaction
        .prepare_cached(
            "INSERT INTO events (job, id, type, at, attempt, data)
             VALUES (?1, (SELECT COALESCE(MAX(id), 0) + 1 FROM events WHERE job = ?1), ?2, ?3, ?4, ?5)",
        )?
        .execute(params![job, kind, crate::clock::now(), attempt as i64, data.to_string()])?;
    Ok(())
}

impl Store {
    /// Up to `limit` events of a job after the number `after`.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn events(&self, job: &str, after: u64, limit: u64) -> Result<Vec<Event>, StoreError> {
        let connection = self.read();
        let mut statement =
            connection.prepare_cached("SELECT * FROM events WHERE job = ?1 AND id > ?2 ORDER BY id LIMIT ?3")?;
        let rows =
            statement.query_map(params![job, i64::try_from(after).unwrap_or(i64::MAX), limit as i64], |row| {
                let data: String = row.get("data")?;
                Ok((
                    Event {
                        id: row.get::<_, i64>("id")? as u64,
                        kind: row.get("type")?,
                        at: row.get("at")?,
                        attempt: row.get::<_, i64>("attempt")? as u64,
                        data: Value::Null,
                    },
                    data,
                ))
            })?;
        rows.map(|row| {
            let (event, data) = row?;
            Ok(Event { data: serde_json::from_str(&data)?, ..event })
        })
        .collect()
    }
}
