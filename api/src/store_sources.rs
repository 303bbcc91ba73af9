//! Checkpoints, uploads and jobs that bodies name, looked up in the store.

use crate::error::ApiError;
use meniscus::scene::CloudSize;
use meniscus_jobs::service::store::{Store, StoreError};
use meniscus_jobs::spec::body::{self, Allowance, JobBody, JobSource, RestartSource, Sources};
use meniscus_jobs::spec::calibration::Calibration;
use meniscus_jobs::spec::uploads::Purpose;
use serde_json::Value;

/// Looks up ids in the store.
pub struct StoreSources<'a> {
    store: &'a Store,
}

impl<'a> StoreSources<'a> {
    /// Sources in this store.
    #[must_use]
    pub fn new(store: &'a Store) -> Self {
        Self { store }
    }

    /// Checks the body of a job, fills in its defaults, and estimates its time.
    ///
    /// # Errors
    /// All that is wrong with the body, or a failing store.
    pub fn resolve(&self, spec: &Value, allowance: Allowance, calibration: &Calibration) -> Result<JobBody, ApiError> {
        let mut body = body::parse(spec, allowance, self)?;
        body.forecast.time_by(calibration);
        Ok(body)
    }
}

impl Sources for StoreSources<'_> {
    type Error = StoreError;

    fn checkpoint(&self, id: &str) -> Result<Option<RestartSource>, StoreError> {
        self.store.restart_source(id)
    }

    fn job(&self, id: &str) -> Result<Option<JobSource>, StoreError> {
        self.store.job_source(id)
    }

    fn uploaded_checkpoint(&self, id: &str) -> Result<Option<RestartSource>, StoreError> {
        self.store.uploaded_restart(id)
    }

    fn uploaded_points(&self, id: &str) -> Result<Option<(Purpose, CloudSize)>, StoreError> {
        let ready = self.store.upload(id)?.filter(|row| row.state == "ready");
        Ok(ready.and_then(|row| Some((row.purpose, row.found?.size()?))))
    }
}
