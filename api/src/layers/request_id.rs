//! An id for every request, which the answer and the log carry.

use axum::extract::Request;
use axum::http::{HeaderName, HeaderValue};
use axum::middleware::Next;
use axum::response::Response;
use ulid::Ulid;

/// Id of a request: `req_` and a ULID.
#[derive(Debug, Clone)]
pub struct RequestId(pub String);

/// Attaches a [`RequestId`] to the request, and the header `X-Request-Id` to the answer.
pub async fn attach(mut request: Request, next: Next) -> Response {
    let id = format!("req_{}", Ulid::generate());
    request.extensions_mut().insert(RequestId(id.clone()));
    let mut response = next.run(request).await;
    if let Ok(value) = HeaderValue::from_str(&id) {
        response.headers_mut().insert(HeaderName::from_static("x-request-id"), value);
    }
    response
}
