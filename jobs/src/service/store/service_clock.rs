//! A clock of the data directory. It counts the seconds for which a service has run on it, and is continued by every start.
//!
//! The time of day may be set while the service runs, or be wrong when it starts. The order of the queue and the age of ended
//! jobs depend on this clock instead. Of the time between two services it counts a day at most.

use super::{Store, StoreError};
use rusqlite::{Connection, params};
use std::time::Instant;

/// Seconds of waiting that weigh as much as one point of priority: nothing waits for ever behind what is more urgent.
pub const AGING_S: f64 = 600.0;

/// Most seconds that pass while no service runs.
const LONGEST_GAP_S: f64 = 86_400.0;

/// A running clock.
#[derive(Debug)]
pub struct ServiceClock {
    start_s: f64,
    started: Instant,
}

impl ServiceClock {
    /// Continues the clock that a store keeps. It never falls behind the queue: a crash loses what was not saved.
    ///
    /// # Errors
    /// [`StoreError`].
    pub(super) fn open(connection: &Connection) -> Result<Self, StoreError> {
        let (saved_s, wall_ms): (f64, i64) =
            connection
                .query_row("SELECT seconds, wall_ms FROM service_clock", [], |row| Ok((row.get(0)?, row.get(1)?)))?;
        let queue_s: Option<f64> = connection.query_row(
            "SELECT MAX(rank + priority * ?1) FROM jobs WHERE state = 'queued'",
            [AGING_S],
            |row| row.get(0),
        )?;
        let gap_s = (crate::system::clock::milliseconds() as f64 - wall_ms as f64) * 1e-3;
        let start_s = (saved_s + gap_s.clamp(0.0, LONGEST_GAP_S)).max(queue_s.unwrap_or(0.0));
        Ok(Self { start_s, started: Instant::now() })
    }

    /// The present reading in seconds.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.start_s + self.started.elapsed().as_secs_f64()
    }
}

impl Store {
    /// Saves the reading of the clock.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn save_clock(&self) -> Result<(), StoreError> {
        let reading = params![self.clock.seconds(), crate::system::clock::milliseconds() as i64];
        self.write(|transaction| {
            transaction.prepare_cached("UPDATE service_clock SET seconds = ?1, wall_ms = ?2")?.execute(reading)?;
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::service::store::{FILE_NAME, Store};

    /// The reading of a store that is opened again after its time of day was changed by so many days.
    fn reading_after_days(days: f64) -> f64 {
        let directory = tempfile::tempdir().unwrap();
        Store::open(directory.path()).unwrap().close();
        let connection = rusqlite::Connection::open(directory.path().join(FILE_NAME)).unwrap();
        let shift = (days * 86_400_000.0) as i64;
        connection.execute("UPDATE service_clock SET wall_ms = wall_ms - ?1", [shift]).unwrap();
        Store::open(directory.path()).unwrap().clock.seconds()
    }

    #[test]
    fn a_clock_that_jumps_counts_as_a_day_at_most() {
        for (days, expected) in [(0.5, 43_200.0), (4000.0, 86_400.0), (-4000.0, 0.0)] {
            let found = reading_after_days(days);
            assert!((found - expected).abs() < 60.0, "{days} days: {found}");
        }
    }
}
