//! Events: what happened to a job, numbered from 1 without gaps.

use super::{Store, StoreError};
use rusqlite::{Row, Transaction, params};
use serde_json::Value;

/// An event of a job.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Number within the job.
    pub id: u64,
    /// `state`, `progress`, `checkpoint`, `frame`, `warning`, `finding`.
    pub kind: String,
    /// Time of the event.
    pub at: String,
    /// Attempt in which it happened.
    pub attempt: u64,
    /// Details, by kind.
    pub data: Value,
}

/// Appends an event to a job, and to the study that it belongs to.
pub(super) fn append(
    transaction: &Transaction,
    job: &str,
    study: Option<&str>,
    attempt: u64,
    kind: &str,
    data: &Value,
) -> Result<(), rusqlite::Error> {
    let id: i64 = transaction
        .prepare_cached(
            "INSERT INTO events (job, id, type, at, attempt, data)
             VALUES (?1, (SELECT COALESCE(MAX(id), 0) + 1 FROM events WHERE job = ?1), ?2, ?3, ?4, ?5) RETURNING id",
        )?
        .query_row(params![job, kind, crate::system::clock::now(), attempt as i64, data.to_string()], |row| {
            row.get(0)
        })?;
    if let Some(study) = study {
        transaction
            .prepare_cached(
                "INSERT INTO study_events (study, id, job, event)
                 VALUES (?1, (SELECT COALESCE(MAX(id), 0) + 1 FROM study_events WHERE study = ?1), ?2, ?3)",
            )?
            .execute(params![study, job, id])?;
    }
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
            statement.query_map(params![job, i64::try_from(after).unwrap_or(i64::MAX), limit as i64], event_of)?;
        rows.map(whole).collect()
    }

    /// Up to `limit` events of all jobs of a study after the number `after`, each with its job; numbered from 1 without
    /// gaps in the study.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn study_events(&self, study: &str, after: u64, limit: u64) -> Result<Vec<(String, Event)>, StoreError> {
        let connection = self.read();
        let mut statement = connection.prepare_cached(
            "SELECT s.job AS job, s.id AS id, e.type AS type, e.at AS at, e.attempt AS attempt, e.data AS data
             FROM study_events s LEFT JOIN events e ON e.job = s.job AND e.id = s.event
             WHERE s.study = ?1 AND s.id > ?2 ORDER BY s.id LIMIT ?3",
        )?;
        let after = i64::try_from(after).unwrap_or(i64::MAX);
        let rows = statement
            .query_map(params![study, after, limit as i64], |row| Ok((row.get::<_, String>("job")?, event_of(row)?)))?;
        rows.map(|row| {
            let (job, event) = row?;
            Ok((job, whole(Ok(event))?))
        })
        .collect()
    }
}

fn event_of(row: &Row) -> rusqlite::Result<(Event, String)> {
    let event = Event {
        id: row.get::<_, i64>("id")? as u64,
        // A job of a study may have been deleted with its events; the study's numbers keep no gap.
        kind: row.get::<_, Option<String>>("type")?.unwrap_or_else(|| "deleted".to_owned()),
        at: row.get::<_, Option<String>>("at")?.unwrap_or_default(),
        attempt: row.get::<_, Option<i64>>("attempt")?.unwrap_or(0) as u64,
        data: Value::Null,
    };
    Ok((event, row.get::<_, Option<String>>("data")?.unwrap_or_else(|| "null".to_owned())))
}

fn whole(row: rusqlite::Result<(Event, String)>) -> Result<Event, StoreError> {
    let (event, data) = row?;
    Ok(Event { data: serde_json::from_str(&data)?, ..event })
}
