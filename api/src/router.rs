//! Every route in one list, and what every answer goes through.

use crate::access;
use crate::application::Application;
use crate::error::ApiError;
use crate::routes::{checkpoints, estimates, events, files, jobs, metrics, results, scenes, service, studies, uploads};
use ::metrics::{counter, histogram};
use axum::Router;
use axum::body::Bytes;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::sync::atomic::Ordering;
use std::time::Instant;
use tower_http::catch_panic::CatchPanicLayer;
use tracing::Instrument;
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
        .routes(routes!(metrics::metrics))
        .routes(routes!(scenes::list))
        .routes(routes!(scenes::get))
        .routes(routes!(estimates::estimate))
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
        .routes(routes!(uploads::submit, uploads::list))
        .routes(routes!(uploads::get, uploads::delete))
        .routes(routes!(studies::submit, studies::list))
        .routes(routes!(studies::get, studies::delete))
        .routes(routes!(studies::jobs_of))
        .routes(routes!(events::of_study))
        .routes(routes!(studies::table))
        .routes(routes!(studies::report))
        .routes(routes!(studies::cancel))
        .routes(routes!(studies::pause))
        .routes(routes!(studies::resume))
        .routes(routes!(studies::retry))
}

/// The document as clients read it: a wildcard `{*path}` is axum's spelling of the parameter `{path}`, problems have a media
/// type of their own, and what any request can meet stands with all of them.
fn published(document: &utoipa::openapi::OpenApi) -> Value {
    let mut document = serde_json::to_value(document).unwrap_or_default();
    if let Some(paths) = document.get_mut("paths").and_then(Value::as_object_mut) {
        *paths = std::mem::take(paths).into_iter().map(|(path, item)| (path.replace("{*", "{"), item)).collect();
        let operations = paths.values_mut().filter_map(Value::as_object_mut).flat_map(|item| item.values_mut());
        for responses in operations.filter_map(|operation| operation.get_mut("responses")?.as_object_mut()) {
            let problem = json!({"schema": {"$ref": "#/components/schemas/Problem"}});
            for (status, what) in ANYWHERE {
                let answer = json!({"description": what, "content": {"application/json": problem}});
                responses.entry(status).or_insert(answer);
            }
            for content in responses.values_mut().filter_map(|r| r.get_mut("content")?.as_object_mut()) {
                if content.get("application/json") == Some(&problem) {
                    content.clear();
                    content.insert("application/problem+json".to_owned(), problem.clone());
                }
            }
        }
    }
    document
}

/// Problems that any request can meet.
const ANYWHERE: [(&str, &str); 6] = [
    ("400", "the path, the query or the body cannot be read"),
    ("401", "a token is needed"),
    ("403", "the token does not allow that, or a page of another origin asks"),
    ("421", "the service does not answer under this name"),
    ("500", "the service failed"),
    ("503", "the service is starting or stopping"),
];

/// The whole service.
pub fn router(application: Application) -> Router {
    let (routes, document) = documented().split_for_parts();
    // Written once: a tree of it would be cloned for every request.
    let document = Bytes::from(published(&document).to_string());
    let document = ([(header::CONTENT_TYPE, "application/json")], document);
    routes
        .route("/openapi.json", axum::routing::get(move || async move { document }))
        .fallback(|| async { ApiError::NotFound("resource") })
        .method_not_allowed_fallback(|| async { ApiError::MethodNotAllowed })
        .layer(middleware::from_fn_with_state(application.clone(), only_when_ready))
        .layer(middleware::from_fn_with_state(application.clone(), access::guard))
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

/// Every answer carries a request id, which the log repeats, and what keeps browsers from guessing.
async fn with_request_id(request: Request, next: Next) -> Response {
    let id = format!("req_{}", Ulid::generate());
    let (method, path, began) = (request.method().clone(), request.uri().path().to_owned(), Instant::now());
    let route = request.extensions().get::<MatchedPath>().map_or("other", MatchedPath::as_str).to_owned();
    let is_reading = method == Method::GET || method == Method::HEAD;
    let span = if is_reading {
        tracing::debug_span!("request", request = id, %method, path)
    } else {
        tracing::info_span!("request", request = id, %method, path)
    };
    let mut response = next.run(request).instrument(span.clone()).await;
    let kind = response.headers().get(header::CONTENT_TYPE);
    let is_plain = kind.is_none_or(|kind| kind.as_bytes().starts_with(b"text/plain"));
    if response.status() == StatusCode::BAD_REQUEST && is_plain {
        // axum's own words for a path or query that is no text.
        response = ApiError::BadRequest.into_response();
    }
    let status = response.status().as_u16();
    let headers = response.headers_mut();
    if let Ok(value) = HeaderValue::from_str(&id) {
        headers.insert(HeaderName::from_static("x-request-id"), value);
    }
    for (name, value) in SECURITY_HEADERS {
        headers.insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-cache"));
    let made = headers.get(header::LOCATION).and_then(|place| place.to_str().ok()).map(str::to_owned);
    let elapsed = began.elapsed();
    counter!("meniscus_http_requests_total", "method" => known_method(&method), "route" => route.clone(), "status" => status.to_string()).increment(1);
    histogram!("meniscus_http_request_seconds", "route" => route).record(elapsed.as_secs_f64());
    // What changes something is told; reading is told to those who ask for it.
    span.in_scope(|| {
        if is_reading {
            tracing::debug!(status, ?elapsed, "answered");
        } else {
            tracing::info!(status, ?elapsed, made, "answered");
        }
    });
    response
}

/// A method by its name, of a closed list: strangers could make up any number of them.
fn known_method(method: &Method) -> &'static str {
    let known = ["GET", "HEAD", "POST", "DELETE", "PUT", "PATCH", "OPTIONS"];
    known.into_iter().find(|name| *name == method.as_str()).unwrap_or("other")
}

/// Nothing here is a page: no script, no frame, no guessing of types.
const SECURITY_HEADERS: [(&str, &str); 5] = [
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-resource-policy", "same-origin"),
    ("content-security-policy", "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'; sandbox"),
];

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
