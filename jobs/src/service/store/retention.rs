//! How long jobs, studies and receipts are kept, by the clock of the data directory: the time of day may jump.

use super::{Store, StoreError, idempotency};
use rusqlite::params;

impl Store {
    /// Deletes jobs that came to their end more than so many days ago, with their files, and studies of which nothing is
    /// left, twenty at a time. Receipts for repeated requests go after a week. Returns how many jobs were deleted.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn expire(&self, days: Option<u32>) -> Result<usize, StoreError> {
        let now_s = self.clock.seconds();
        self.write(|transaction| idempotency::expire(transaction, now_s))?;
        let Some(days) = days else { return Ok(0) };
        let before_s = now_s - f64::from(days) * idempotency::DAY_S;
        let old: Vec<String> = {
            let connection = self.read();
            // What a restart that has not ended began with was linked; nothing else holds on to a job.
            let mut statement =
                connection.prepare_cached("SELECT id FROM jobs WHERE ended_s IS NOT NULL AND ended_s < ?1 LIMIT 20")?;
            let rows = statement.query_map([before_s], |row| row.get(0))?;
            rows.collect::<Result<_, _>>()?
        };
        for id in &old {
            if let Err(error) = self.delete(id) {
                tracing::error!(job = id, %error, "an old job could not be deleted");
            }
        }
        self.write(|transaction| -> Result<(), StoreError> {
            for table in ["study_events WHERE study", "levels WHERE study", "studies WHERE id"] {
                transaction.execute(
                    &format!(
                        "DELETE FROM {table} IN (SELECT id FROM studies s WHERE made_s < ?1
                             AND NOT EXISTS (SELECT 1 FROM jobs WHERE study = s.id)
                             AND NOT EXISTS (SELECT 1 FROM refinements WHERE study = s.id AND state <> 'ended'))"
                    ),
                    params![before_s],
                )?;
            }
            transaction.execute("DELETE FROM refinements WHERE study NOT IN (SELECT id FROM studies)", [])?;
            Ok(())
        })?;
        Ok(old.len())
    }
}
