//! Requests that make something: their bodies under a limit, the client's budget, and `Idempotency-Key`.

use crate::access::{Budget, Client};
use crate::application::Application;
use crate::error::{ApiError, ProblemItem};
use crate::routes::with_store;
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use meniscus::scene::Violation;
use meniscus_jobs::service::store::{KeptAnswer, Made, Once};
use meniscus_jobs::spec::strict_json;
use meniscus_jobs::system::digest;
use serde_json::{Value, json};

/// A request that makes something, with its whole body.
#[derive(Debug)]
pub struct Creation {
    /// The body.
    pub bytes: Vec<u8>,
    /// The client's key, if it gave one.
    pub once: Option<Once>,
    /// What was made under the key before.
    pub known: Option<Made>,
    budget: Option<Budget>,
}

/// Longest `Idempotency-Key`.
const LONGEST_KEY: usize = 255;

impl Creation {
    /// Takes a request in: the budget first, then the body up to a limit, then the key.
    ///
    /// # Errors
    /// [`ApiError`].
    pub async fn take(application: &Application, request: Request, limit: usize) -> Result<Self, ApiError> {
        let (parts, body) = request.into_parts();
        let client = parts.extensions.get::<Client>().cloned().unwrap_or_default();
        let key = key_of(&parts.headers)?;
        let bytes = read(&parts.headers, body, limit).await?;
        let target = parts.uri.path_and_query().map_or("", |target| target.as_str());
        let once = key.map(|key| Once {
            owner: client.0.clone(),
            key,
            request_sha256: digest::of_bytes(
                &[parts.method.as_str().as_bytes(), target.as_bytes(), &bytes].join(&b'\n'),
            ),
        });
        // What was made before is told again, whatever else is left to the client.
        let known = match once.clone() {
            Some(once) => with_store(application, move |store| Ok(store.recall(&once)?)).await?,
            None => None,
        };
        let budget = if known.is_some() { None } else { spend(application, &client)? };
        Ok(Self { bytes, once, known, budget })
    }

    /// The body as JSON.
    ///
    /// # Errors
    /// [`ApiError::Unparsable`].
    pub fn json(&self) -> Result<Value, ApiError> {
        strict_json::parse(&self.bytes).map_err(|error| ApiError::Unparsable(error.to_string()))
    }

    /// What the client is told.
    ///
    /// # Errors
    /// [`ApiError`].
    pub fn answer(&self, made: Made) -> Result<Response, ApiError> {
        answer(made, self.budget)
    }
}

/// Takes one creation from a client's budget.
pub(crate) fn spend(application: &Application, client: &Client) -> Result<Option<Budget>, ApiError> {
    application.config.access.spend(client).map_err(ApiError::TooMany)
}

/// The client's key.
pub(crate) fn key_of(headers: &HeaderMap) -> Result<Option<String>, ApiError> {
    let Some(value) = headers.get("idempotency-key") else { return Ok(None) };
    let key = value.to_str().ok().filter(|key| !key.is_empty() && key.len() <= LONGEST_KEY);
    key.map(|key| Some(key.to_owned())).ok_or_else(|| {
        let allowed = json!(format!("1 to {LONGEST_KEY} visible ASCII characters"));
        let violation = Violation::new("Idempotency-Key", "range", "the key is no key", &Value::Null, allowed);
        ApiError::Invalid(vec![ProblemItem::from(violation)])
    })
}

/// The length of a body, where it is announced.
pub(crate) fn announced(headers: &HeaderMap) -> Option<u64> {
    headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

/// Reads a body; too long ones are refused before they are read, where their length is announced.
pub(crate) async fn read(headers: &HeaderMap, body: Body, limit: usize) -> Result<Vec<u8>, ApiError> {
    if announced(headers).is_some_and(|length| length > limit as u64) {
        return Err(ApiError::TooLarge(limit as u64));
    }
    let bytes = axum::body::to_bytes(body, limit).await.map_err(|error| {
        let text = std::error::Error::source(&error).map_or_else(|| error.to_string(), ToString::to_string);
        if text.contains("length limit") { ApiError::TooLarge(limit as u64) } else { ApiError::Unparsable(text) }
    })?;
    Ok(bytes.into())
}

/// What a client is told of what was made.
pub(crate) fn answer(made: Made, budget: Option<Budget>) -> Result<Response, ApiError> {
    let (kept, is_replay) = match made {
        Made::New(kept) => (kept, false),
        Made::Replayed(kept) => (kept, true),
        Made::KeyOfAnother => {
            let detail = "the key was used for another request";
            let violation = Violation::new("Idempotency-Key", "conflict", detail, &Value::Null, Value::Null);
            return Err(ApiError::Invalid(vec![ProblemItem::from(violation)]));
        }
    };
    let status = StatusCode::from_u16(kept.status).unwrap_or(StatusCode::OK);
    let mut response = (status, [(header::CONTENT_TYPE, "application/json")], kept.body).into_response();
    let headers = response.headers_mut();
    if let Some(location) = kept.location.and_then(|place| HeaderValue::from_str(&place).ok()) {
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

/// An answer to be kept.
pub(crate) fn kept(status: StatusCode, location: Option<String>, body: &impl serde::Serialize) -> KeptAnswer {
    // Views are plain data; they always become JSON.
    let body = serde_json::to_string(body).unwrap_or_default();
    KeptAnswer { status: status.as_u16(), location, body }
}
