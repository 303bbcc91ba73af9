//! Uploads: files from outside, quarantined until a process of its own has inspected them.

use super::idempotency::{IdempotencyKey, Made, Receipt};
use super::{Store, StoreError, deletion, remove_directory, rows};
use crate::spec::body::{Origin, RestartSource, resolved_scene};
use crate::spec::uploads::{Contents, Purpose};
use crate::system::artifacts;
use rusqlite::{Connection, OptionalExtension, Row, params};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Name of the file as it was sent, in the directory of the upload.
pub const CONTENT: &str = "content";
/// Name of the points that were found in it, in our own plain format.
pub const CLOUD: &str = "cloud.bin";

/// Name of the record of an upload that was inspected.
const RECORD: &str = "upload.json";

/// What the database has of an inspected upload, as a file beside it: by it the upload comes back into a database that was
/// lost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UploadRecord {
    /// Id of the upload.
    pub id: String,
    /// What it is to be used as.
    pub purpose: Purpose,
    /// Name that the client gave.
    pub name: Option<String>,
    /// Size in bytes.
    pub size_bytes: u64,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Time at which it came in.
    pub created_at: String,
    /// Name of the token that made it.
    pub owner: Option<String>,
    /// Why it was rejected.
    pub reason: Option<String>,
    /// What was found in it; None where it was rejected.
    pub found: Option<Contents>,
}

impl UploadRecord {
    /// The record in the folder of an upload; None where there is none that can be read.
    #[must_use]
    pub fn read(folder: &Path) -> Option<Self> {
        serde_json::from_slice(&std::fs::read(folder.join(RECORD)).ok()?).ok()
    }
}

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
    /// Name of the token that made it; None without tokens.
    pub owner: Option<String>,
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
    /// Name of the token that makes it; None without tokens.
    pub owner: Option<String>,
}

impl Store {
    /// The directory of an upload.
    #[must_use]
    pub fn upload_directory(&self, id: &str) -> PathBuf {
        self.uploads_directory().join(id)
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
                "INSERT INTO uploads (id, purpose, state, name, size_bytes, sha256, created_at, owner)
                 VALUES (?1, ?2, 'quarantined', ?3, ?4, ?5, ?6, ?7)",
                params![
                    upload.id,
                    upload.purpose.word(),
                    upload.name,
                    upload.size_bytes as i64,
                    upload.sha256,
                    crate::system::clock::now(),
                    upload.owner,
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
        let checked_at = crate::system::clock::now();
        self.write(|transaction| -> Result<(), StoreError> {
            transaction.execute(
                "UPDATE uploads SET state = ?2, reason = ?3, found = ?4, checked_at = ?5 WHERE id = ?1",
                params![id, state, reason, found, checked_at],
            )?;
            Ok(())
        })?;
        self.upload(id)?.map_or(Ok(()), |row| self.write_record(row))
    }

    /// Writes the record of an inspected upload into its folder.
    fn write_record(&self, row: UploadRow) -> Result<(), StoreError> {
        let UploadRow { id, purpose, name, size_bytes, sha256, created_at, owner, reason, found, .. } = row;
        let path = self.upload_directory(&id).join(RECORD);
        let record = UploadRecord { id, purpose, name, size_bytes, sha256, created_at, owner, reason, found };
        Ok(artifacts::write(&path, &serde_json::to_vec_pretty(&record)?)?)
    }

    /// Writes the records of inspected uploads that have none, such as those of an earlier version.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn write_missing_records(&self) -> Result<(), StoreError> {
        let rows = self.uploads(None, u64::MAX >> 1)?;
        let is_missing = |row: &UploadRow| {
            let folder = self.upload_directory(&row.id);
            row.checked_at.is_some() && folder.is_dir() && !folder.join(RECORD).is_file()
        };
        rows.into_iter().filter(is_missing).try_for_each(|row| self.write_record(row))
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
        let folder = format!("{}/{id}", super::UPLOADS);
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
            deletion::intend(transaction, &folder)?;
            Ok(true)
        })?;
        if deleted {
            self.delete_folder(&folder)?;
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
        owner: row.get("owner")?,
    })
}
