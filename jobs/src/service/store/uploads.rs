//! Uploads: files from outside, quarantined until a process of its own has inspected them.

use super::idempotency::{IdempotencyKey, Made, Receipt};
use super::{Store, StoreError, remove_directory, rows};
use crate::spec::body::{Origin, RestartSource, resolved_scene};
use crate::spec::uploads::{Contents, Purpose};
use rusqlite::{Connection, OptionalExtension, Row, params};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Name of the file as it was sent, in the directory of the upload.
pub const CONTENT: &str = "content";
/// Name of the points that were found in it, in our own plain format.
pub const CLOUD: &str = "cloud.bin";

/// An upload as the store has it.
#[derive(Debug, Clone, PartialEq)]
pub struct UploadRow {
    /// Id of the upload.
    pub id: String,
    /// What it is to be used as.
    pub purpose: Purpose,
    /// `quarantined`, `ready` or `rejected`.
    pub state: String,
    /// Why it was rejected.
    pub reason: Option<String>,
    /// What the inspection found in it; None before and where it was rejected.
    pub found: Option<Contents>,
    /// Name that the client gave.
    pub name: Option<String>,
    /// Size in bytes.
    pub size_bytes: u64,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Time at which it came in.
    pub created_at: String,
    /// Time at which the inspection ended.
    pub checked_at: Option<String>,
}

/// A file that has come in whole.
#[derive(Debug, Clone)]
pub struct NewUpload {
    /// Id, which its directory has already.
    pub id: String,
    /// What it is to be used as.
    pub purpose: Purpose,
    /// Name that the client gave.
    pub name: Option<String>,
    /// Size in bytes.
    pub size_bytes: u64,
    /// SHA-256 of the file.
    pub sha256: String,
}

impl Store {
    /// The directory of an upload.
    #[must_use]
    pub fn upload_directory(&self, id: &str) -> PathBuf {
        self.directory().join("uploads").join(id)
    }

    /// An id and a directory for a file that is about to come in.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn begin_upload(&self) -> Result<(String, PathBuf), StoreError> {
        let id = format!("upl_{}", self.next_id());
        let directory = self.upload_directory(&id);
        std::fs::create_dir_all(&directory)?;
        Ok((id, directory))
    }

    /// Removes the directory of an upload that was cut short.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn abandon_upload(&self, id: &str) -> Result<(), StoreError> {
        Ok(remove_directory(&self.upload_directory(id))?)
    }

    /// Enters a file that has come in whole and durably, as quarantined.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn make_upload(
        &self,
        upload: &NewUpload,
        key: Option<&IdempotencyKey>,
        receipt: impl FnOnce(&UploadRow) -> Receipt,
    ) -> Result<Made, StoreError> {
        let made = self.make_once(key, |transaction| {
            transaction.execute(
                "INSERT INTO uploads (id, purpose, state, name, size_bytes, sha256, created_at)
                 VALUES (?1, ?2, 'quarantined', ?3, ?4, ?5, ?6)",
                params![
                    upload.id,
                    upload.purpose.word(),
                    upload.name,
                    upload.size_bytes as i64,
                    upload.sha256,
                    crate::system::clock::now()
                ],
            )?;
            Ok(receipt(&upload_of_id(transaction, &upload.id)?.ok_or(rusqlite::Error::QueryReturnedNoRows)?))
        });
        if !matches!(made, Ok(Made::New(_))) {
            self.abandon_upload(&upload.id)?;
        }
        made
    }

    /// Enters the outcome of an inspection.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn finish_upload(&self, id: &str, verdict: &Result<Contents, String>) -> Result<(), StoreError> {
        let (state, reason, found) = match verdict {
            Ok(found) => ("ready", None, Some(serde_json::to_string(found)?)),
            Err(reason) => ("rejected", Some(reason), None),
        };
        self.write(|transaction| -> Result<(), StoreError> {
            transaction.execute(
                "UPDATE uploads SET state = ?2, reason = ?3, found = ?4, checked_at = ?5 WHERE id = ?1",
                params![id, state, reason, found, crate::system::clock::now()],
            )?;
            Ok(())
        })
    }

    /// An upload by id.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn upload(&self, id: &str) -> Result<Option<UploadRow>, StoreError> {
        upload_of_id(&self.read(), id)
    }

    /// A page of uploads, newest first.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn uploads(&self, cursor: Option<&str>, limit: u64) -> Result<Vec<UploadRow>, StoreError> {
        let connection = self.read();
        let mut statement =
            connection.prepare_cached("SELECT * FROM uploads WHERE ?1 IS NULL OR id < ?1 ORDER BY id DESC LIMIT ?2")?;
        let rows = statement.query_map(params![cursor, limit as i64], upload_of)?;
        Ok(rows.collect::<Result<_, _>>()?)
    }

    /// Uploads that were not inspected yet.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn quarantined_uploads(&self) -> Result<Vec<UploadRow>, StoreError> {
        let connection = self.read();
        let mut statement =
            connection.prepare_cached("SELECT * FROM uploads WHERE state = 'quarantined' ORDER BY id")?;
        let rows = statement.query_map([], upload_of)?;
        Ok(rows.collect::<Result<_, _>>()?)
    }

    /// The points that a job takes from uploads, by their ids.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn inputs(&self, job: &str) -> Result<BTreeMap<String, PathBuf>, StoreError> {
        let connection = self.read();
        let mut statement = connection.prepare_cached("SELECT upload FROM inputs WHERE job = ?1")?;
        let ids = statement.query_map([job], |row| row.get::<_, String>(0))?;
        let place = |id: String| (id.clone(), self.upload_directory(&id).join(CLOUD));
        Ok(ids.map(|id| id.map(place)).collect::<Result<_, _>>()?)
    }

    /// Deletes an upload; false while a job that has not ended uses it, or before it was inspected.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn delete_upload(&self, id: &str) -> Result<bool, StoreError> {
        let deleted = self.write(|transaction| -> Result<bool, StoreError> {
            let users: i64 = transaction.query_row(
                "SELECT (SELECT COUNT(*) FROM inputs i JOIN jobs j ON j.id = i.job WHERE i.upload = ?1
                         AND j.state NOT IN ('succeeded', 'failed', 'canceled'))
                      + (SELECT COUNT(*) FROM uploads WHERE id = ?1 AND state = 'quarantined')",
                [id],
                |row| row.get(0),
            )?;
            if users > 0 {
                return Ok(false);
            }
            transaction.execute("DELETE FROM uploads WHERE id = ?1", [id])?;
            Ok(true)
        })?;
        if deleted {
            remove_directory(&self.upload_directory(id))?;
        }
        Ok(deleted)
    }

    /// What a restart from an uploaded checkpoint needs to know; None where it is not there, is no checkpoint, or has not
    /// passed its inspection.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn uploaded_restart(&self, id: &str) -> Result<Option<RestartSource>, StoreError> {
        let Some(row) = self.upload(id)?.filter(|row| row.state == "ready" && row.purpose == Purpose::Checkpoint)
        else {
            return Ok(None);
        };
        let Some(Contents::Checkpoint(found)) = row.found else { return Ok(None) };
        let (origin, scene) = (Origin::Upload(row.id), resolved_scene(&found.body)?);
        Ok(Some(RestartSource { origin, scene, isa: found.isa, step: found.step }))
    }
}

fn upload_of_id(connection: &Connection, id: &str) -> Result<Option<UploadRow>, StoreError> {
    Ok(connection.prepare_cached("SELECT * FROM uploads WHERE id = ?1")?.query_row([id], upload_of).optional()?)
}

fn upload_of(row: &Row) -> rusqlite::Result<UploadRow> {
    let purpose: String = row.get("purpose")?;
    Ok(UploadRow {
        id: row.get("id")?,
        purpose: Purpose::from_word(&purpose).ok_or(rusqlite::Error::InvalidQuery)?,
        state: row.get("state")?,
        reason: row.get("reason")?,
        found: rows::json(row, "found")?,
        name: row.get("name")?,
        size_bytes: row.get::<_, i64>("size_bytes")? as u64,
        sha256: row.get("sha256")?,
        created_at: row.get("created_at")?,
        checked_at: row.get("checked_at")?,
    })
}
