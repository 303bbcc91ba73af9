//! Counts of jobs and uploads by state, and the size of the store.

use super::service_clock::AGING_S;
use super::{FILE_NAME, Store, StoreError};
use crate::spec::states::State;
use std::collections::BTreeMap;

/// Counts over the whole store.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Statistics {
    /// Jobs by state.
    pub by_state: BTreeMap<State, u64>,
    /// Seconds that the oldest job of the queue has waited.
    pub oldest_queued_s: f64,
    /// Uploads that were not inspected yet.
    pub quarantined: u64,
    /// Size of the SQLite file and its log.
    pub store_bytes: u64,
}

impl Statistics {
    /// Jobs that have not ended.
    #[must_use]
    pub fn unfinished(&self) -> u64 {
        self.by_state.iter().filter(|(state, _)| !state.is_terminal()).map(|(_, count)| count).sum()
    }
}

impl Store {
    /// Counts jobs and uploads.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn statistics(&self) -> Result<Statistics, StoreError> {
        let connection = self.read();
        let mut statistics = Statistics::default();
        {
            let mut statement = connection.prepare_cached("SELECT state, COUNT(*) FROM jobs GROUP BY state")?;
            let rows = statement.query_map([], |row| Ok((row.get::<_, String>(0)?, row.get::<_, i64>(1)? as u64)))?;
            for row in rows {
                let (word, count) = row?;
                statistics.by_state.extend(State::from_word(&word).map(|state| (state, count)));
            }
        }
        statistics.oldest_queued_s = connection.query_row(
            "SELECT COALESCE(MAX(0.0, ?1 - MIN(rank + priority * ?2)), 0.0) FROM jobs WHERE state = 'queued'",
            [self.clock.seconds(), AGING_S],
            |row| row.get(0),
        )?;
        statistics.quarantined =
            connection
                .query_row("SELECT COUNT(*) FROM uploads WHERE state = 'quarantined'", [], |row| row.get::<_, i64>(0))?
                as u64;
        let size = |name: &str| std::fs::metadata(self.directory().join(name)).map_or(0, |meta| meta.len());
        statistics.store_bytes = size(FILE_NAME) + size(&format!("{FILE_NAME}-wal"));
        Ok(statistics)
    }
}
