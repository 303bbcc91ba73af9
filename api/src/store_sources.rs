//! Checkpoints and uploads that bodies name, looked up in the store.

use crate::error::ApiError;
use meniscus_jobs::service::store::{Store, StoreError};
use meniscus_jobs::spec::body::{self, Allowance, JobBody, RestartSource, Sources};
use meniscus_jobs::spec::calibration::Calibration;
use meniscus_jobs::spec::uploads::Purpose;
use serde_json::Value;
use std::cell::RefCell;

/// Looks up ids in the store. A failure of the store is remembered, since it does not mean that the id is unknown.
pub struct StoreSources<'a> {
    store: &'a Store,
    failure: RefCell<Option<StoreError>>,
}

impl<'a> StoreSources<'a> {
    /// Sources in this store.
    #[must_use]
    pub fn new(store: &'a Store) -> Self {
        Self { store, failure: RefCell::new(None) }
    }

    /// Checks the body of a job, fills in its defaults, and estimates its time.
    ///
    /// # Errors
    /// All that is wrong with the body, or a failing store.
    pub fn understand(
        &self,
        spec: &Value,
        allowance: Allowance,
        calibration: &Calibration,
    ) -> Result<JobBody, ApiError> {
        let body = body::parse(spec, allowance, self);
        self.check()?;
        let mut body = body?;
        body.forecast.time_by(calibration);
        Ok(body)
    }

    /// Reports a failure of the store since the last check.
    ///
    /// # Errors
    /// The failure.
    pub fn check(&self) -> Result<(), ApiError> {
        self.failure.take().map_or(Ok(()), |error| Err(error.into()))
    }

    fn found<T>(&self, found: Result<Option<T>, StoreError>) -> Option<T> {
        found.unwrap_or_else(|error| {
            self.failure.replace(Some(error));
            None
        })
    }
}

impl Sources for StoreSources<'_> {
    fn checkpoint(&self, id: &str) -> Option<RestartSource> {
        self.found(self.store.restart_source(id))
    }

    fn uploaded_checkpoint(&self, id: &str) -> Option<RestartSource> {
        self.found(self.store.uploaded_restart(id))
    }

    fn uploaded_points(&self, id: &str) -> Option<(Purpose, u64)> {
        let row = self.found(self.store.upload(id)).filter(|row| row.state == "ready")?;
        let points = row.found?.points()?;
        Some((row.purpose, points))
    }
}
