//! Whether the store is whole and agrees with itself.

use super::{Store, StoreError};
use crate::spec::states::State;
use rusqlite::OptionalExtension;

impl Store {
    /// What SQLite finds wrong with its file, and rows that point nowhere.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn integrity(&self) -> Result<Vec<String>, StoreError> {
        let connection = self.read();
        let mut wrong: Vec<String> = {
            let mut statement = connection.prepare("PRAGMA integrity_check")?;
            let rows = statement.query_map([], |row| row.get::<_, String>(0))?;
            rows.collect::<Result<_, _>>()?
        };
        wrong.retain(|line| line != "ok");
        for (what, sql) in [
            ("events without a job", "SELECT COUNT(DISTINCT job) FROM events WHERE job NOT IN (SELECT id FROM jobs)"),
            ("files without a job", "SELECT COUNT(*) FROM files WHERE job NOT IN (SELECT id FROM jobs)"),
            ("checkpoints without a job", "SELECT COUNT(*) FROM checkpoints WHERE job NOT IN (SELECT id FROM jobs)"),
            ("inputs without a job", "SELECT COUNT(*) FROM inputs WHERE job NOT IN (SELECT id FROM jobs)"),
            (
                "jobs of studies that are gone",
                "SELECT COUNT(*) FROM jobs WHERE study IS NOT NULL AND study NOT IN (SELECT id FROM studies)",
            ),
            (
                "levels of studies that are gone",
                "SELECT COUNT(*) FROM levels WHERE study NOT IN (SELECT study FROM refinements)",
            ),
            (
                "points of studies with two latest jobs",
                "SELECT COUNT(*) FROM (SELECT 1 FROM jobs WHERE study IS NOT NULL AND superseded = 0
                     GROUP BY study, study_index HAVING COUNT(*) > 1)",
            ),
        ] {
            let count: i64 = connection.query_row(sql, [], |row| row.get(0))?;
            if count > 0 {
                wrong.push(format!("{count} {what}"));
            }
        }
        Ok(wrong)
    }

    /// Whether a job's events are numbered from 1 without gaps.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn events_are_whole(&self, job: &str) -> Result<bool, StoreError> {
        let connection = self.read();
        Ok(connection
            .prepare_cached("SELECT MIN(id) = 1 AND MAX(id) = COUNT(*) FROM events WHERE job = ?1")?
            .query_row([job], |row| row.get::<_, Option<bool>>(0))?
            .unwrap_or(false))
    }

    /// The state that the last event of a change of state names.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn state_of_last_event(&self, job: &str) -> Result<Option<State>, StoreError> {
        let connection = self.read();
        let word: Option<String> = connection
            .prepare_cached(
                "SELECT json_extract(data, '$.to') FROM events WHERE job = ?1 AND type = 'state' ORDER BY id DESC LIMIT 1",
            )?
            .query_row([job], |row| row.get(0))
            .optional()?;
        Ok(word.as_deref().and_then(State::from_word))
    }
}
