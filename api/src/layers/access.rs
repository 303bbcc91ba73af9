//! Refuses requests to unknown host names, from pages of other origins, and without the needed token.

use crate::access::{AccessError, Client, Scope};
use crate::error::ApiError;
use crate::state::AppState;
use axum::extract::{Request, State};
use axum::http::{header, uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Lets a request pass if the access rules allow it, and attaches the [`Client`].
pub async fn check(State(state): State<AppState>, mut request: Request, next: Next) -> Response {
    match allowed(&state, &request) {
        Ok(client) => {
            request.extensions_mut().insert(client);
            next.run(request).await
        }
        Err(error) => error.into_response(),
    }
}

fn allowed(state: &AppState, request: &Request) -> Result<Client, ApiError> {
    let rules = &state.config.access;
    let text = |name| request.headers().get(name).and_then(|value| value.to_str().ok());
    // A request line may name the host instead of the header.
    let host = request.uri().authority().map(uri::Authority::as_str).or_else(|| text(header::HOST));
    if !host.is_some_and(|host| rules.is_known_host(host)) {
        return Err(ApiError::UnknownHost);
    }
    // A page of another origin must not create jobs through a person's browser.
    let is_foreign = |origin: &str| !origin.split_once("://").is_some_and(|(_, host)| rules.is_known_host(host));
    if text(header::ORIGIN).is_some_and(is_foreign) {
        return Err(ApiError::ForeignOrigin);
    }
    let Some(scope) = Scope::needed(request.method(), request.uri().path()) else { return Ok(Client::default()) };
    rules.client(request.headers(), scope).map_err(|error| match error {
        AccessError::Unauthorized => ApiError::Unauthorized,
        AccessError::Forbidden(scope) => ApiError::Forbidden(scope.word()),
    })
}
