//! Ids that rise: also within a millisecond, when the clock is set back, and over restarts. Pages are cut at ids, so an
//! id that falls would shift them.

use super::StoreError;
use rusqlite::Connection;
use std::sync::{Mutex, PoisonError};
use ulid::Ulid;

/// Gives out ids.
#[derive(Debug)]
pub struct RisingIds {
    last: Mutex<Ulid>,
}

impl RisingIds {
    /// Ids above all that the store has.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn above(connection: &Connection) -> Result<Self, StoreError> {
        let mut last = Ulid::default();
        for table in ["jobs", "studies", "uploads"] {
            let newest: Option<String> =
                connection.query_row(&format!("SELECT MAX(id) FROM {table}"), [], |row| row.get(0))?;
            let ulid = newest.and_then(|id| id.split_once('_')?.1.parse().ok());
            last = last.max(ulid.unwrap_or_default());
        }
        Ok(Self { last: Mutex::new(last) })
    }

    /// The next one.
    #[must_use]
    pub fn next(&self) -> Ulid {
        self.next_with(|| ()).0
    }

    /// Makes later ids rise above this one.
    pub fn rise_above(&self, id: Ulid) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        *last = id.max(*last);
    }

    /// The next one, with a value that is taken at its turn: no other id is given out in between.
    pub fn next_with<R>(&self, value: impl FnOnce() -> R) -> (Ulid, R) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let fresh = Ulid::from_parts(crate::system::clock::milliseconds(), Ulid::generate().random());
        *last = if fresh > *last { fresh } else { last.increment().unwrap_or(fresh) };
        (*last, value())
    }
}
