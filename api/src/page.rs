//! The web page: files that are part of the program. It uses the public API alone; it is loaded without a token, and its requests
//! need what all requests need.

use crate::base_path;
use crate::error::ApiError;
use crate::layers::encoding::Verbatim;
use axum::extract::{OriginalUri, Request};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Redirect, Response};

/// A file of the page.
struct Asset {
    /// Name below the service's address.
    name: &'static str,
    media_type: &'static str,
    etag: &'static str,
    bytes: &'static [u8],
    /// The same by gzip.
    compressed: &'static [u8],
}

static ASSETS: &[Asset] = include!(concat!(env!("OUT_DIR"), "/page.rs"));

/// Name of the file that the address of the service itself answers with.
const INDEX: &str = "index.html";

/// Mark of an answer that belongs to the page: it may run its own scripts.
#[derive(Debug, Clone, Copy)]
pub struct PageFile;

/// Whether a path is a file of the page; these need no token, since one signs in by them.
#[must_use]
pub fn has(path: &str) -> bool {
    find(path).is_some()
}

fn find(path: &str) -> Option<&'static Asset> {
    let name = path.strip_prefix(base_path::get()).unwrap_or(path).trim_start_matches('/');
    let name = if name.is_empty() { INDEX } else { name };
    ASSETS.iter().find(|asset| asset.name == name)
}

/// Answers with a file of the page, or says that there is no such resource.
pub async fn get(OriginalUri(original): OriginalUri, request: Request) -> Response {
    let Some(asset) = find(request.uri().path()) else { return ApiError::NotFound("resource").into_response() };
    if *request.method() != Method::GET && *request.method() != Method::HEAD {
        return ApiError::MethodNotAllowed.into_response();
    }
    // The addresses in the page are relative to a folder.
    if asset.name == INDEX && !original.path().ends_with('/') && !original.path().ends_with(INDEX) {
        return Redirect::permanent(&format!("{}/", original.path())).into_response();
    }
    answer(asset, request.headers())
}

fn answer(asset: &Asset, asked: &HeaderMap) -> Response {
    let text = |name| asked.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let mut headers = HeaderMap::new();
    headers.insert(header::ETAG, HeaderValue::from_static(asset.etag));
    headers.insert(header::VARY, HeaderValue::from_static("accept-encoding"));
    // It is asked for every time, and sent where it has changed.
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    let marks = (axum::Extension(PageFile), axum::Extension(Verbatim));
    if text(header::IF_NONE_MATCH).split(',').any(|tag| tag.trim().trim_start_matches("W/") == asset.etag) {
        return (StatusCode::NOT_MODIFIED, marks, headers).into_response();
    }
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(asset.media_type));
    let is_compressed =
        text(header::ACCEPT_ENCODING).split(',').any(|word| word.trim().split(';').next() == Some("gzip"));
    if is_compressed {
        headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static("gzip"));
    }
    (marks, headers, if is_compressed { asset.compressed } else { asset.bytes }).into_response()
}

#[cfg(test)]
mod tests {
    use super::{ASSETS, answer, find, has};
    use axum::http::{HeaderMap, HeaderValue, StatusCode, header};

    #[test]
    fn the_address_itself_is_the_page_and_paths_of_the_api_are_none_of_it() {
        assert_eq!(find("/").unwrap().name, "index.html");
        assert!(has("/index.html") && !has("/v1/jobs") && !has("/../Cargo.toml"));
        assert!(ASSETS.iter().all(|asset| !asset.bytes.is_empty() && asset.compressed.len() > 20));
    }

    #[test]
    fn a_file_is_sent_once() {
        let asset = find("/").unwrap();
        let mut asked = HeaderMap::new();
        asked.insert(header::ACCEPT_ENCODING, HeaderValue::from_static("br, gzip;q=0.8"));
        let first = answer(asset, &asked);
        assert_eq!(
            (first.status(), &first.headers()[header::CONTENT_ENCODING]),
            (StatusCode::OK, &HeaderValue::from_static("gzip"))
        );
        asked.insert(header::IF_NONE_MATCH, first.headers()[header::ETAG].clone());
        assert_eq!(answer(asset, &asked).status(), StatusCode::NOT_MODIFIED);
    }
}
