//! Deleting folders. A row and the intention to delete its folder go in one transaction, so that a deletion that a crash or
//! the system cut short is done later, and its folder is never taken for one that the database has lost.

use super::{Store, StoreError, remove_directory};
use rusqlite::Transaction;

/// Notes the intention to delete a folder below the data directory, such as `jobs/job_…`.
pub(super) fn intend(transaction: &Transaction, folder: &str) -> rusqlite::Result<()> {
    transaction.prepare_cached("INSERT OR IGNORE INTO deletions (folder) VALUES (?1)")?.execute([folder]).map(|_| ())
}

impl Store {
    /// Folders whose deletion was intended and not done yet.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn intended_deletions(&self) -> Result<Vec<String>, StoreError> {
        let connection = self.read();
        let mut statement = connection.prepare_cached("SELECT folder FROM deletions ORDER BY folder")?;
        let rows = statement.query_map([], |row| row.get(0))?;
        Ok(rows.collect::<Result<_, _>>()?)
    }

    /// Deletes the folders whose deletion was intended. A folder that the system does not let go is tried again later.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn delete_intended(&self) -> Result<(), StoreError> {
        for folder in self.intended_deletions()? {
            self.delete_folder(&folder)?;
        }
        Ok(())
    }

    /// Deletes one folder whose deletion was intended.
    pub(super) fn delete_folder(&self, folder: &str) -> Result<(), StoreError> {
        if self.is_written_to(folder) {
            tracing::info!(folder, "a process may still write there; the folder is deleted later");
            return Ok(());
        }
        if let Err(error) = remove_directory(&self.directory().join(folder)) {
            tracing::warn!(folder, %error, "a folder could not be deleted; it is tried again later");
            return Ok(());
        }
        self.write(|transaction| {
            transaction.prepare_cached("DELETE FROM deletions WHERE folder = ?1")?.execute([folder])?;
            Ok(())
        })
    }

    /// Whether an attempt of a job's folder may still have a process.
    fn is_written_to(&self, folder: &str) -> bool {
        let (Some(writes), Some(job)) = (self.orphans.get(), folder.strip_prefix(super::JOBS)) else { return false };
        let job = job.trim_start_matches('/');
        let entries = std::fs::read_dir(self.job_directory(job).join("attempts")).into_iter().flatten().flatten();
        let mut epochs = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        epochs.any(|epoch| writes(job, epoch))
    }
}
