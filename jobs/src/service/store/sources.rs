//! Checkpoints, uploads and jobs that bodies name, looked up in the store.

use super::{Store, StoreError};
use crate::spec::body::{JobSource, RestartSource, Sources};
use crate::spec::uploads::Purpose;
use meniscus::scene::CloudSize;

impl Sources for Store {
    type Error = StoreError;

    fn checkpoint(&self, id: &str) -> Result<Option<RestartSource>, StoreError> {
        self.restart_source(id)
    }

    fn job(&self, id: &str) -> Result<Option<JobSource>, StoreError> {
        self.job_source(id)
    }

    fn uploaded_checkpoint(&self, id: &str) -> Result<Option<RestartSource>, StoreError> {
        self.uploaded_restart(id)
    }

    fn uploaded_points(&self, id: &str) -> Result<Option<(Purpose, CloudSize)>, StoreError> {
        let ready = self.upload(id)?.filter(|row| row.state == "ready");
        Ok(ready.and_then(|row| Some((row.purpose, row.found?.size()?))))
    }
}
