//! `Idempotency-Key`: a request that comes twice under one key is carried out once, and gets the same answer twice.
//!
//! The store keeps the answer in the transaction that did the work.

use crate::access::Client;
use crate::error::ApiError;
use crate::rate_limit::Budget;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use meniscus_jobs::service::store::{IdempotencyKey, Made, Receipt};
use meniscus_jobs::system::digest;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Name of the header.
const HEADER: &str = "Idempotency-Key";
/// Longest key in bytes.
const LONGEST_KEY: usize = 255;

/// The key that a client gave, if it gave one.
///
/// # Errors
/// [`ApiError::Invalid`] if the key is empty, too long, or not ASCII.
pub fn key(headers: &HeaderMap) -> Result<Option<String>, ApiError> {
    let Some(value) = headers.get(HEADER) else { return Ok(None) };
    let key = value.to_str().ok().filter(|key| !key.is_empty() && key.len() <= LONGEST_KEY);
    key.map(|key| Some(key.to_owned())).ok_or_else(|| {
        let allowed = json!(format!("1 to {LONGEST_KEY} visible ASCII characters"));
        ApiError::invalid(HEADER, "range", "the Idempotency-Key is not valid", &Value::Null, allowed)
    })
}

/// The request under a key: the same one has the same method, target and body.
#[must_use]
pub fn keyed_request(client: Client, key: String, request: &[&[u8]]) -> IdempotencyKey {
    IdempotencyKey { owner: client.name, key, fingerprint: digest::of_bytes(&request.join(&b'\n')) }
}

/// An answer as its receipt has it. Receipts are kept for days: the names stay what they are.
#[derive(Serialize, Deserialize)]
struct StoredResponse {
    status: u16,
    location: Option<String>,
    body: String,
}

/// An answer for the store to keep, in a form that only [`response`] reads.
#[must_use]
pub fn stored_response(status: StatusCode, location: Option<String>, body: &impl Serialize) -> Receipt {
    // Views are plain data; they always become JSON.
    let body = serde_json::to_string(body).unwrap_or_default();
    let stored = StoredResponse { status: status.as_u16(), location, body };
    Receipt(serde_json::to_vec(&stored).unwrap_or_default())
}

/// The answer to a request that was carried out, now or before.
///
/// # Errors
/// [`ApiError::Invalid`] if the key belongs to another request; [`ApiError::Internal`] if the receipt cannot be read.
pub fn response(made: Made, budget: Option<Budget>) -> Result<Response, ApiError> {
    let (receipt, is_replay) = match made {
        Made::New(receipt) => (receipt, false),
        Made::Replayed(receipt) => (receipt, true),
        Made::KeyOfAnother => {
            let detail = "the Idempotency-Key was already used for another request; use a new key";
            return Err(ApiError::invalid(HEADER, "conflict", detail, &Value::Null, Value::Null));
        }
    };
    let stored: StoredResponse =
        serde_json::from_slice(&receipt.0).map_err(|error| ApiError::Internal(format!("a kept answer: {error}")))?;
    let status = StatusCode::from_u16(stored.status).unwrap_or(StatusCode::OK);
    let mut response = (status, [(header::CONTENT_TYPE, "application/json")], stored.body).into_response();
    let headers = response.headers_mut();
    if let Some(location) = stored.location.and_then(|place| HeaderValue::from_str(&place).ok()) {
        headers.insert(header::LOCATION, location);
    }
    if is_replay {
        headers.insert(HeaderName::from_static("idempotent-replayed"), HeaderValue::from_static("true"));
    }
    if let Some(budget) = budget {
        budget.write(headers);
    }
    Ok(response)
}
