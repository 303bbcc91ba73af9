//! Bodies of jobs, read with what the store knows of the ids that they name.

use crate::error::ApiError;
use meniscus_jobs::service::store::Store;
use meniscus_jobs::spec::body::{self, Allowance, JobBody};
use meniscus_jobs::spec::calibration::Calibration;
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
        let mut body = body::parse(spec, allowance, self.store)?;
        body.forecast.time_by(calibration);
        Ok(body)
    }
}
