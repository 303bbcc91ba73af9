//! Encodings of bodies: requests may be compressed by gzip, texts are answered so where the client asks.

use crate::error::ApiError;
use axum::extract::Request;
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use tower_http::compression::predicate::{Predicate, SizeAbove};

/// Least size of an answer that is worth compressing, in bytes.
const LEAST_BYTES: u64 = 1024;

/// Mark of an answer whose bytes are those of a file: digest, length and ranges are of these bytes.
#[derive(Debug, Clone, Copy)]
pub struct Verbatim;

/// Whether an answer is compressed: JSON, CSV, pictures and texts, but no files, archives and streams.
#[derive(Debug, Clone, Copy)]
pub struct IsText;

impl Predicate for IsText {
    fn should_compress<B: axum::body::HttpBody>(&self, response: &axum::http::Response<B>) -> bool {
        let media_type = response.headers().get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
        let media_type = media_type.unwrap_or_default().split(';').next().unwrap_or_default().trim();
        let is_text = media_type.ends_with("json")
            || media_type == "image/svg+xml"
            || media_type.starts_with("text/") && media_type != "text/event-stream";
        is_text
            && response.extensions().get::<Verbatim>().is_none()
            && SizeAbove::new(LEAST_BYTES).should_compress(response)
    }
}

/// Refuses bodies in encodings that are not read.
pub async fn check(request: Request, next: Next) -> Response {
    if request.method() != Method::GET && !is_read(request.headers()) {
        return ApiError::UnsupportedEncoding.into_response();
    }
    next.run(request).await
}

fn is_read(headers: &HeaderMap) -> bool {
    let encodings = headers.get_all(header::CONTENT_ENCODING).iter();
    encodings.into_iter().all(|value| {
        value.to_str().is_ok_and(|text| text.eq_ignore_ascii_case("gzip") || text.eq_ignore_ascii_case("identity"))
    })
}
