//! Every route in one list, and what every answer goes through.

use crate::application::Application;
use crate::error::ApiError;
use crate::routes::{checkpoints, events, files, jobs, results, scenes, service};
use axum::extract::{Request, State};
use axum::http::{HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::{Json, Router};
use serde_json::Value;
use std::sync::atomic::Ordering;
use std::time::Instant;
use tower_http::catch_panic::CatchPanicLayer;
use ulid::Ulid;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

#[derive(OpenApi)]
#[openapi(info(
    title = "Meniscus",
    description = "Jobs for moving interfaces and the physics on them. Errors are application/problem+json (RFC 9457)."
))]
struct Document;

/// The routes and the document that describes them.
fn documented() -> OpenApiRouter<Application> {
    OpenApiRouter::with_openapi(Document::openapi())
        .routes(routes!(service::index))
        .routes(routes!(service::health))
        .routes(routes!(service::ready))
        .routes(routes!(scenes::list))
        .routes(routes!(scenes::get))
        .routes(routes!(jobs::submit, jobs::list))
        .routes(routes!(jobs::get, jobs::delete))
        .routes(routes!(jobs::cancel))
        .routes(routes!(jobs::pause))
        .routes(routes!(jobs::resume))
        .routes(routes!(events::events))
        .routes(routes!(results::log))
        .routes(routes!(results::series))
        .routes(routes!(results::report))
        .routes(routes!(files::list))
        .routes(routes!(files::tar))
        .routes(routes!(files::get))
        .routes(routes!(checkpoints::list, checkpoints::request))
        .routes(routes!(checkpoints::latest))
        .routes(routes!(checkpoints::get, checkpoints::delete))
        .routes(routes!(checkpoints::content))
}

/// The document as clients read it: a wildcard `{*path}` is axum's spelling of the parameter `{path}`.
fn published(document: &utoipa::openapi::OpenApi) -> Value {
    let mut document = serde_json::to_value(document).unwrap_or_default();
    if let Some(paths) = document.get_mut("paths").and_then(Value::as_object_mut) {
        *paths = std::mem::take(paths).into_iter().map(|(path, item)| (path.replace("{*", "{"), item)).collect();
    }
    document
}

/// The whole service.
pub fn router(application: Application) -> Router {
    let (routes, document) = documented().split_for_parts();
    let document = Json(published(&document));
    routes
        .route("/openapi.json", axum::routing::get(move || async move { document }))
        .fallback(|| async { ApiError::NotFound("resource") })
        .method_not_allowed_fallback(|| async { ApiError::MethodNotAllowed })
        .layer(middleware::from_fn_with_state(application.clone(), only_when_ready))
        .layer(CatchPanicLayer::custom(|_| ApiError::Internal("a handler panicked".to_owned()).into_response()))
        .layer(middleware::from_fn(with_request_id))
        .with_state(application)
}

/// Nothing under `/v1` is answered from a store that is not recovered yet; during a shutdown it can still be read.
async fn only_when_ready(State(application): State<Application>, request: Request, next: Next) -> Response {
    let reads = request.method() == Method::GET || request.method() == Method::HEAD;
    let is_ready = application.ready.load(Ordering::Acquire);
    let is_readable = reads && application.draining.load(Ordering::Acquire);
    if !is_ready && !is_readable && request.uri().path().starts_with("/v1") {
        return ApiError::NotReady.into_response();
    }
    next.run(request).await
}

/// Every answer carries a request id, which the log repeats.
async fn with_request_id(request: Request, next: Next) -> Response {
    let id = format!("req_{}", Ulid::generate());
    let (method, path, began) = (request.method().clone(), request.uri().path().to_owned(), Instant::now());
    let mut response = next.run(request).await;
    let kind = response.headers().get(header::CONTENT_TYPE);
    let is_plain = kind.is_none_or(|kind| kind.as_bytes().starts_with(b"text/plain"));
    if response.status() == StatusCode::BAD_REQUEST && is_plain {
        // axum's own words for a path or query that is no text.
        response = ApiError::BadRequest.into_response();
    }
    if let Ok(value) = HeaderValue::from_str(&id) {
        response.headers_mut().insert(HeaderName::from_static("x-request-id"), value);
    }
    let headers = response.headers_mut();
    headers.insert(HeaderName::from_static("x-content-type-options"), HeaderValue::from_static("nosniff"));
    tracing::debug!(id, %method, path, status = response.status().as_u16(), elapsed = ?began.elapsed(), "request");
    response
}

#[cfg(test)]
mod tests {
    use super::{documented, published};

    #[test]
    fn the_document_is_openapi_31_and_names_every_schema_it_uses() {
        let (_, document) = documented().split_for_parts();
        let json = published(&document);
        assert!(json["paths"]["/v1/jobs/{id}/files/{path}"]["get"].is_object());
        assert!(json["openapi"].as_str().unwrap().starts_with("3.1"));
        let text = json.to_string();
        for reference in text.split("\"#/components/schemas/").skip(1) {
            let name = reference.split('"').next().unwrap();
            assert!(json["components"]["schemas"].get(name).is_some(), "{name}");
        }
        assert!(json["paths"]["/v1/jobs"]["post"]["responses"]["422"].is_object());
    }
}
