//! Requests that are carried out once, however often they come: the answer is kept under the client's key, in the
//! transaction that did the work.

use super::StoreError;
use rusqlite::{OptionalExtension, Transaction, params};

/// A request with a key of the client's.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Once {
    /// Whose key it is.
    pub owner: String,
    /// `Idempotency-Key`.
    pub key: String,
    /// Digest of method, path and body.
    pub request_sha256: String,
}

/// An answer as it was given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptAnswer {
    /// Status code.
    pub status: u16,
    /// `Location`.
    pub location: Option<String>,
    /// The body.
    pub body: String,
}

/// What became of a request that makes something.
#[derive(Debug)]
pub enum Made {
    /// It was carried out now.
    New(KeptAnswer),
    /// It had been carried out before.
    Replayed(KeptAnswer),
    /// The key was used for another request.
    KeyOfAnother,
}

/// Days that an answer is kept at least.
pub const KEPT_DAYS: i64 = 7;

/// The answer that was given under this key before.
pub(super) fn recall(transaction: &rusqlite::Connection, once: &Once) -> Result<Option<Made>, StoreError> {
    let found = transaction
        .prepare_cached("SELECT request_sha256, status, location, body FROM answers WHERE owner = ?1 AND key = ?2")?
        .query_row(params![once.owner, once.key], |row| {
            let answer = KeptAnswer { status: row.get(1)?, location: row.get(2)?, body: row.get(3)? };
            Ok((row.get::<_, String>(0)?, answer))
        })
        .optional()?;
    Ok(found.map(
        |(sha256, answer)| {
            if sha256 == once.request_sha256 { Made::Replayed(answer) } else { Made::KeyOfAnother }
        },
    ))
}

/// Keeps an answer.
pub(super) fn keep(transaction: &Transaction, once: &Once, answer: &KeptAnswer) -> Result<(), StoreError> {
    transaction
        .prepare_cached(
            "INSERT INTO answers (owner, key, request_sha256, status, location, body, created_at)
             VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
        )?
        .execute(params![
            once.owner,
            once.key,
            once.request_sha256,
            answer.status,
            answer.location,
            answer.body,
            crate::system::clock::now()
        ])?;
    Ok(())
}
