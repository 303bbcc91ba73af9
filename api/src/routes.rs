//! Handlers, one file a resource.

pub mod checkpoints;
pub mod events;
pub mod files;
pub mod jobs;
pub mod results;
pub mod scenes;
pub mod service;

use crate::application::Application;
use crate::error::ApiError;
use meniscus_jobs::store::{JobRow, Store};
use std::sync::Arc;

/// Runs work on the store away from the threads that answer.
pub(crate) async fn with_store<R: Send + 'static>(
    application: &Application,
    work: impl FnOnce(&Store) -> Result<R, ApiError> + Send + 'static,
) -> Result<R, ApiError> {
    let store = Arc::clone(&application.store);
    tokio::task::spawn_blocking(move || work(&store)).await?
}

/// A job that must be there.
pub(crate) async fn job(application: &Application, id: &str) -> Result<JobRow, ApiError> {
    let id = id.to_owned();
    with_store(application, move |store| store.job(&id)?.ok_or(ApiError::NotFound("job"))).await
}
