//! Cache of serialized jobs, keyed by version: a job that has not changed is not serialized again.

use axum::body::Bytes;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Most jobs in the cache.
const CAPACITY: usize = 512;

/// Version of a job: its revision and the count of its progress records.
pub type Version = (i64, i64);

/// The newest JSON of each job that was asked for. Clones share one cache.
#[derive(Debug, Clone, Default)]
pub struct ResponseCache {
    by_id: Arc<Mutex<HashMap<String, (Version, Bytes)>>>,
}

impl ResponseCache {
    /// The JSON of a job in this version, if the cache has it.
    #[must_use]
    pub fn get(&self, id: &str, version: Version) -> Option<Bytes> {
        let by_id = self.by_id.lock().unwrap_or_else(PoisonError::into_inner);
        by_id.get(id).filter(|(known, _)| *known == version).map(|(_, bytes)| bytes.clone())
    }

    /// Stores the JSON of a job. A full cache is emptied first.
    pub fn put(&self, id: &str, version: Version, bytes: Bytes) {
        let mut by_id = self.by_id.lock().unwrap_or_else(PoisonError::into_inner);
        if by_id.len() >= CAPACITY {
            by_id.clear();
        }
        by_id.insert(id.to_owned(), (version, bytes));
    }
}

#[cfg(test)]
mod tests {
    use super::ResponseCache;

    #[test]
    fn only_the_asked_version_is_answered() {
        let cache = ResponseCache::default();
        cache.put("job_1", (1, 2), "{}".into());
        assert_eq!(cache.get("job_1", (1, 2)).as_deref(), Some("{}".as_bytes()));
        assert!(cache.get("job_1", (1, 3)).is_none() && cache.get("job_2", (1, 2)).is_none());
    }
}
