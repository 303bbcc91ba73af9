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
use axum::http::{HeaderMap, header};
use meniscus_jobs::service::store::{JobRow, Store};
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

/// Whether a client asks for one kind of answer and not for the other.
pub(crate) fn accepts(headers: &HeaderMap, kind: &str, other: &str) -> bool {
    let accept = headers.get(header::ACCEPT).and_then(|v| v.to_str().ok());
    accept.is_some_and(|accept| accept.contains(kind) && !accept.contains(other))
}

/// A job that must be there.
pub(crate) async fn job(application: &Application, id: &str) -> Result<JobRow, ApiError> {
    // One row by its key is read in less time than it takes to hand it to another thread.
    application.store.job(id)?.ok_or(ApiError::NotFound("job"))
}
