//! Requests that create objects: body, idempotency key, and the client's budget.

use crate::access::Client;
use crate::error::ApiError;
use crate::rate_limit::Budget;
use crate::state::AppState;
use crate::{idempotency, request_body};
use axum::extract::Request;
use axum::response::Response;
use meniscus_jobs::service::store::{IdempotencyKey, Made, Store};
use meniscus_jobs::system::process;
use serde_json::Value;

/// A request that creates something, with its whole body.
#[derive(Debug)]
pub struct Creation {
    body: Vec<u8>,
    /// The request under the client's key, if it gave one.
    pub keyed: Option<IdempotencyKey>,
    /// What was created under the key before.
    pub known: Option<Made>,
    /// Owner of what is made.
    pub owner: Option<String>,
    budget: Option<Budget>,
}

impl Creation {
    /// Receives a request: checks its key, reads its body up to a limit in bytes, looks the key up, and takes one
    /// creation from the client's budget if nothing was created under the key before.
    ///
    /// # Errors
    /// [`ApiError`] for a wrong key, an unreadable or too large body, an exhausted budget, or a failing store.
    pub async fn receive(state: &AppState, request: Request, limit: usize) -> Result<Self, ApiError> {
        let (parts, body) = request.into_parts();
        let client = parts.extensions.get::<Client>().cloned().unwrap_or_default();
        let key = idempotency::key(&parts.headers)?;
        let body = request_body::read(&parts.headers, body, limit).await?;
        let target = parts.uri.path_and_query().map_or("", |target| target.as_str());
        let request = [parts.method.as_str().as_bytes(), target.as_bytes(), &body];
        let keyed = key.map(|key| idempotency::keyed_request(client.clone(), key, &request));
        // A known answer is repeated even if the client has no budget left.
        let known = match keyed.clone() {
            Some(keyed) => state.with_store(move |store| Ok::<_, ApiError>(store.recall(&keyed)?)).await?,
            None => None,
        };
        let budget = if known.is_some() { None } else { spend(state, &client)? };
        Ok(Self { body, keyed, known, owner: client.owner(), budget })
    }

    /// The body as JSON.
    ///
    /// # Errors
    /// [`ApiError::Unparsable`].
    pub fn json(&self) -> Result<Value, ApiError> {
        request_body::parse_json(&self.body)
    }

    /// The answer to the client.
    ///
    /// # Errors
    /// As [`idempotency::response`].
    pub fn respond(&self, made: Made) -> Result<Response, ApiError> {
        idempotency::response(made, self.budget)
    }
}

/// Takes one creation from a client's budget.
///
/// # Errors
/// [`ApiError::TooMany`].
pub fn spend(state: &AppState, client: &Client) -> Result<Option<Budget>, ApiError> {
    state.config.rate_limiter.spend(&client.name).map_err(ApiError::TooMany)
}

/// Bytes that are free on the disk beyond the reserve.
#[must_use]
pub fn free_bytes(state: &AppState) -> u64 {
    let free = process::free_space(state.store.jobs_directory()).unwrap_or(u64::MAX);
    free.saturating_sub(state.config.disk_reserve_bytes)
}

/// Refuses jobs whose files would not fit on the disk, or that exceed the operator's limit of unfinished jobs.
///
/// # Errors
/// [`ApiError::NoSpace`], [`ApiError::QuotaReached`].
pub fn check_capacity(state: &AppState, store: &Store, jobs: u64, disk_bytes: u64) -> Result<(), ApiError> {
    let free = free_bytes(state);
    if disk_bytes > free {
        return Err(ApiError::NoSpace { needed: disk_bytes, free });
    }
    if let Some(most) = state.config.most_unfinished {
        let unfinished = store.statistics()?.unfinished();
        if unfinished + jobs > most {
            return Err(ApiError::QuotaReached { unfinished, most });
        }
    }
    Ok(())
}
