//! Handlers, one file a resource.

pub mod checkpoints;
pub mod estimates;
pub mod events;
pub mod files;
pub mod jobs;
pub mod metrics;
mod page;
pub mod results;
pub mod scenes;
pub mod service;
mod sources;
pub mod studies;
pub mod uploads;

pub(crate) use page::{Page, flag, number, refuse_unknown};
pub(crate) use sources::StoreSources;

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
    // What is logged inside keeps the id of the request.
    let span = tracing::Span::current();
    tokio::task::spawn_blocking(move || span.in_scope(|| work(&store))).await?
}

/// A job that must be there.
pub(crate) async fn job(application: &Application, id: &str) -> Result<JobRow, ApiError> {
    // One row by its key is read in less time than it takes to hand it to another thread.
    application.store.job(id)?.ok_or(ApiError::NotFound("job"))
}
