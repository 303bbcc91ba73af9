//! Idempotency: a request that makes something is carried out once, however often it comes. In the transaction that makes
//! the resource the store keeps a receipt under the client's key. It does not look into receipts.

use super::{Store, StoreError};
use rusqlite::{Connection, OptionalExtension, Transaction, params};

/// The key under which a client repeats a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct IdempotencyKey {
    /// The client that chose the key.
    pub owner: String,
    /// The key, as the client wrote it.
    pub key: String,
    /// Digest of the request: the same key with another request is a mistake.
    pub fingerprint: String,
}

/// What the caller told its client when a resource was made, in an encoding of the caller's own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Receipt(pub Vec<u8>);

/// Outcome of a request that makes something.
#[derive(Debug)]
pub enum Made {
    /// It was carried out now.
    New(Receipt),
    /// It had been carried out before; the receipt is the one kept then.
    Replayed(Receipt),
    /// The key belongs to another request.
    KeyOfAnother,
}

/// Days that a receipt is kept at least.
pub const KEPT_DAYS: f64 = 7.0;
/// Seconds of a day.
pub(super) const DAY_S: f64 = 86_400.0;

/// The outcome that is kept under a key; None where the key is new.
pub(super) fn recall(connection: &Connection, key: &IdempotencyKey) -> Result<Option<Made>, StoreError> {
    let found: Option<(String, Vec<u8>)> = connection
        .prepare_cached("SELECT fingerprint, receipt FROM receipts WHERE owner = ?1 AND key = ?2")?
        .query_row(params![key.owner, key.key], |row| Ok((row.get(0)?, row.get(1)?)))
        .optional()?;
    let outcome = |(fingerprint, receipt)| {
        if fingerprint == key.fingerprint { Made::Replayed(Receipt(receipt)) } else { Made::KeyOfAnother }
    };
    Ok(found.map(outcome))
}

/// Keeps a receipt under a key.
fn keep(transaction: &Transaction, key: &IdempotencyKey, receipt: &Receipt) -> Result<(), StoreError> {
    let now = crate::system::clock::now();
    transaction
        .prepare_cached(
            "INSERT INTO receipts (owner, key, fingerprint, receipt, created_at, made_s)
             VALUES (?1, ?2, ?3, ?4, ?5, (SELECT seconds FROM service_clock))",
        )?
        .execute(params![key.owner, key.key, key.fingerprint, receipt.0, now])?;
    Ok(())
}

/// Carries out work that makes something and keeps its receipt, unless the key says that it was done before.
pub(super) fn make_once(
    transaction: &Transaction,
    key: Option<&IdempotencyKey>,
    work: impl FnOnce(&Transaction) -> Result<Receipt, StoreError>,
) -> Result<Made, StoreError> {
    if let Some(made) = key.map(|key| recall(transaction, key)).transpose()?.flatten() {
        return Ok(made);
    }
    let receipt = work(transaction)?;
    if let Some(key) = key {
        keep(transaction, key, &receipt)?;
    }
    Ok(Made::New(receipt))
}

/// Deletes receipts that are older than they need to be, by the clock of the data directory.
pub(super) fn expire(transaction: &Transaction, clock_s: f64) -> Result<(), StoreError> {
    transaction.execute("DELETE FROM receipts WHERE made_s < ?1", [clock_s - KEPT_DAYS * DAY_S])?;
    Ok(())
}

impl Store {
    /// Makes something in one transaction, unless the key says that it was made before.
    pub(super) fn make_once(
        &self,
        key: Option<&IdempotencyKey>,
        work: impl FnOnce(&Transaction) -> Result<Receipt, StoreError>,
    ) -> Result<Made, StoreError> {
        self.write(|transaction| make_once(transaction, key, work))
    }

    /// The outcome that is kept under a client's key, so that nothing needs to be computed again.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn recall(&self, key: &IdempotencyKey) -> Result<Option<Made>, StoreError> {
        recall(&self.read(), key)
    }
}

#[cfg(test)]
mod tests {
    use super::{IdempotencyKey, Made, Receipt};
    use crate::service::store::{Store, StoreError};
    use std::cell::Cell;

    fn key(fingerprint: &str) -> IdempotencyKey {
        IdempotencyKey { owner: "owner".to_owned(), key: "key".to_owned(), fingerprint: fingerprint.to_owned() }
    }

    #[test]
    fn work_is_done_once_under_a_key_and_its_receipt_comes_back_byte_by_byte() {
        let directory = tempfile::tempdir().unwrap();
        let store = Store::open(directory.path()).unwrap();
        let (count, receipt) = (Cell::new(0), Receipt(vec![0, 255, b'{']));
        let work = || {
            count.set(count.get() + 1);
            Ok::<_, StoreError>(receipt.clone())
        };
        let first = store.make_once(Some(&key("a")), |_| work()).unwrap();
        assert!(matches!(first, Made::New(found) if found == receipt));
        let second = store.make_once(Some(&key("a")), |_| work()).unwrap();
        assert!(matches!(second, Made::Replayed(found) if found == receipt));
        assert!(matches!(store.make_once(Some(&key("b")), |_| work()).unwrap(), Made::KeyOfAnother));
        assert!(matches!(store.make_once(None, |_| work()).unwrap(), Made::New(_)));
        assert_eq!(count.get(), 2);
    }

    #[test]
    fn failed_work_leaves_no_receipt() {
        let directory = tempfile::tempdir().unwrap();
        let store = Store::open(directory.path()).unwrap();
        assert!(store.make_once(Some(&key("a")), |_| Err(StoreError::UploadGone)).is_err());
        assert!(store.recall(&key("a")).unwrap().is_none());
    }
}
