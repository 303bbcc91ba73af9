//! Jobs as they were last shown: who asks again for what has not changed gets the same bytes.

use axum::body::Bytes;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Answers that are kept at most.
const MOST: usize = 512;

/// A job's JSON, and the version that it is of.
type Shown = ((i64, i64), Bytes);

/// The last answers by job.
#[derive(Debug, Clone, Default)]
pub struct ShownJobs {
    by_id: Arc<Mutex<HashMap<String, Shown>>>,
}

impl ShownJobs {
    /// The JSON of a job in a version, as it was shown before.
    #[must_use]
    pub fn get(&self, id: &str, version: (i64, i64)) -> Option<Bytes> {
        let by_id = self.by_id.lock().unwrap_or_else(PoisonError::into_inner);
        by_id.get(id).filter(|(known, _)| *known == version).map(|(_, bytes)| bytes.clone())
    }

    /// Keeps the JSON of a job.
    pub fn put(&self, id: &str, version: (i64, i64), bytes: Bytes) {
        let mut by_id = self.by_id.lock().unwrap_or_else(PoisonError::into_inner);
        if by_id.len() >= MOST {
            by_id.clear();
        }
        by_id.insert(id.to_owned(), (version, bytes));
    }
}
