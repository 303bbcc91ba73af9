//! Refuses requests while the store is not recovered. During a shutdown it can still be read.

use crate::error::ApiError;
use crate::state::AppState;
use axum::extract::{Request, State};
use axum::http::Method;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Lets a request below `/v1` pass if the service is ready, or if it only reads while the service drains.
pub async fn check(State(state): State<AppState>, request: Request, next: Next) -> Response {
    let is_reading = request.method() == Method::GET || request.method() == Method::HEAD;
    let is_served = state.phase.is_ready() || is_reading && state.phase.is_draining();
    if !is_served && request.uri().path().starts_with("/v1") {
        return ApiError::NotReady.into_response();
    }
    next.run(request).await
}
