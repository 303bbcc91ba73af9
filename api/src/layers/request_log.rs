//! Log lines and metrics of requests. Requests that change something are logged at level info, reads at debug.

use crate::layers::request_id::RequestId;
use axum::extract::{MatchedPath, Request};
use axum::http::{Method, header};
use axum::middleware::Next;
use axum::response::Response;
use metrics::{counter, histogram};
use std::time::Instant;
use tracing::Instrument;

/// Counts a request, measures the time to the head of its answer, and logs it in a span with the request's id.
pub async fn record(request: Request, next: Next) -> Response {
    let id = request.extensions().get::<RequestId>().map(|id| id.0.clone()).unwrap_or_default();
    let (method, path, start) = (request.method().clone(), request.uri().path().to_owned(), Instant::now());
    let route = request.extensions().get::<MatchedPath>().map_or("other", MatchedPath::as_str).to_owned();
    let is_reading = method == Method::GET || method == Method::HEAD;
    let span = if is_reading {
        tracing::debug_span!("request", request = id, %method, path)
    } else {
        tracing::info_span!("request", request = id, %method, path)
    };
    let response = next.run(request).instrument(span.clone()).await;
    let (status, elapsed) = (response.status().as_u16(), start.elapsed());
    let labels =
        [("method", known_method(&method).to_owned()), ("route", route.clone()), ("status", status.to_string())];
    counter!("meniscus_http_requests_total", &labels).increment(1);
    histogram!("meniscus_http_request_seconds", "route" => route).record(elapsed.as_secs_f64());
    let created = response.headers().get(header::LOCATION).and_then(|place| place.to_str().ok());
    span.in_scope(|| {
        if is_reading {
            tracing::debug!(status, ?elapsed, "answered");
        } else {
            tracing::info!(status, ?elapsed, created, "answered");
        }
    });
    response
}

/// The name of a method. Unknown names share one label, since clients could invent any number of them.
fn known_method(method: &Method) -> &'static str {
    let known = ["GET", "HEAD", "POST", "DELETE", "PUT", "PATCH", "OPTIONS"];
    known.into_iter().find(|name| *name == method.as_str()).unwrap_or("other")
}
