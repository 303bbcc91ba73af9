//! Bodies of requests, read up to a limit.

use crate::error::ApiError;
use axum::body::Body;
use axum::http::{HeaderMap, header};
use meniscus_jobs::spec::strict_json;
use serde_json::Value;
use std::error::Error;

/// Length of a body in bytes, if the request announces it.
#[must_use]
pub fn announced_length(headers: &HeaderMap) -> Option<u64> {
    headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

/// Reads a body of at most `limit` bytes. A longer one is refused before it is read, if its length is announced.
///
/// # Errors
/// [`ApiError::TooLarge`], or [`ApiError::Unparsable`] if the connection broke.
pub async fn read(headers: &HeaderMap, body: Body, limit: usize) -> Result<Vec<u8>, ApiError> {
    if announced_length(headers).is_some_and(|length| length > limit as u64) {
        return Err(ApiError::TooLarge(limit as u64));
    }
    let bytes = axum::body::to_bytes(body, limit).await.map_err(|error| {
        let text = error.source().map_or_else(|| error.to_string(), ToString::to_string);
        if text.contains("length limit") { ApiError::TooLarge(limit as u64) } else { ApiError::Unparsable(text) }
    })?;
    Ok(bytes.into())
}

/// A body as JSON.
///
/// # Errors
/// [`ApiError::Unparsable`].
pub fn parse_json(bytes: &[u8]) -> Result<Value, ApiError> {
    // Some editors begin a text with a byte order mark.
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    strict_json::parse(text).map_err(|error| ApiError::Unparsable(error.to_string()))
}
