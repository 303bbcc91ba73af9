//! Answers with the content of a file: Range, If-Range, If-None-Match, and strong entity tags from digests.

use crate::error::ApiError;
use crate::layers::encoding::Verbatim;
use axum::body::Body;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::Response;
use base64::Engine;
use std::io::SeekFrom;
use std::path::Path;
use tokio::io::{AsyncReadExt, AsyncSeekExt};
use tokio_util::io::ReaderStream;

/// Facts of a file for the headers of its answer.
#[derive(Debug, Clone)]
pub struct FileFacts {
    /// SHA-256 in hexadecimal, which is the strong entity tag. None while the file still grows.
    pub sha256: Option<String>,
    /// Media type of the content.
    pub media_type: String,
    /// Name under which clients save the file.
    pub name: String,
}

/// Answers with a file, or with the part of it that the headers of the request ask for.
///
/// # Errors
/// [`ApiError::NotFound`] without the file, [`ApiError::RangeNotSatisfiable`], or a failing disk.
pub async fn file_response(path: &Path, facts: &FileFacts, headers: &HeaderMap) -> Result<Response, ApiError> {
    let mut file = match tokio::fs::File::open(path).await {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err(ApiError::NotFound("file"));
        }
        file => file?,
    };
    let size = file.metadata().await?.len();
    let part = match part_of(facts, headers, size)? {
        Part::NotModified => {
            return answer(StatusCode::NOT_MODIFIED, facts, None, 0, Body::empty());
        }
        Part::Whole => None,
        Part::Range(first, last) => Some((first, last)),
    };
    let (first, last) = part.unwrap_or((0, size.saturating_sub(1)));
    let length = if size == 0 { 0 } else { last - first + 1 };
    file.seek(SeekFrom::Start(first)).await?;
    let body = Body::from_stream(ReaderStream::with_capacity(file.take(length), 1 << 16));
    let status = if part.is_some() { StatusCode::PARTIAL_CONTENT } else { StatusCode::OK };
    answer(status, facts, part.map(|(first, last)| format!("bytes {first}-{last}/{size}")), length, body)
}

/// Answers with bytes in memory, or with the part of them that the headers of the request ask for.
///
/// # Errors
/// [`ApiError::RangeNotSatisfiable`].
pub fn bytes_response(bytes: &[u8], facts: &FileFacts, headers: &HeaderMap) -> Result<Response, ApiError> {
    let size = bytes.len() as u64;
    match part_of(facts, headers, size)? {
        Part::NotModified => answer(StatusCode::NOT_MODIFIED, facts, None, 0, Body::empty()),
        Part::Whole => answer(StatusCode::OK, facts, None, size, Body::from(bytes.to_vec())),
        Part::Range(first, last) => {
            let part = bytes[first as usize..=last as usize].to_vec();
            let range = format!("bytes {first}-{last}/{size}");
            answer(StatusCode::PARTIAL_CONTENT, facts, Some(range), last - first + 1, Body::from(part))
        }
    }
}

enum Part {
    Whole,
    NotModified,
    Range(u64, u64),
}

fn part_of(facts: &FileFacts, headers: &HeaderMap, size: u64) -> Result<Part, ApiError> {
    let text = |name: HeaderName| headers.get(name).and_then(|v| v.to_str().ok());
    let tag = facts.sha256.as_ref().map(|sha256| format!("\"{sha256}\""));
    if let (Some(tag), Some(known)) = (&tag, text(header::IF_NONE_MATCH)) {
        let matches = known.split(',').any(|one| one.trim().trim_start_matches("W/") == tag) || known.trim() == "*";
        if matches {
            return Ok(Part::NotModified);
        }
    }
    // A part of a new version would not fit to what the client has of an old one.
    if text(header::IF_RANGE).is_some_and(|known| Some(known.trim()) != tag.as_deref()) {
        return Ok(Part::Whole);
    }
    match text(header::RANGE).and_then(parse_range) {
        None => Ok(Part::Whole),
        Some(range) => {
            let resolved = match range {
                (Some(first), last) => (first, last.unwrap_or(u64::MAX).min(size.saturating_sub(1))),
                (None, Some(suffix)) if suffix > 0 => (size.saturating_sub(suffix), size.saturating_sub(1)),
                (None, _) => (size, 0),
            };
            if size > 0 && resolved.0 < size && resolved.0 <= resolved.1 {
                Ok(Part::Range(resolved.0, resolved.1))
            } else {
                Err(ApiError::RangeNotSatisfiable(size))
            }
        }
    }
}

/// Parses `bytes=a-b`, `bytes=a-` and `bytes=-n`. Anything else, including several ranges, is ignored as RFC 9110 allows.
fn parse_range(text: &str) -> Option<(Option<u64>, Option<u64>)> {
    let (first, last) = text.trim().strip_prefix("bytes=")?.split_once('-')?;
    let number = |text: &str| {
        if text.is_empty() { Some(None) } else { text.parse::<u64>().ok().map(Some) }
    };
    let (first, last) = (number(first.trim())?, number(last.trim())?);
    let ordered = first.zip(last).is_none_or(|(first, last)| first <= last);
    (ordered && (first.is_some() || last.is_some())).then_some((first, last))
}

fn answer(
    status: StatusCode,
    facts: &FileFacts,
    range: Option<String>,
    length: u64,
    body: Body,
) -> Result<Response, ApiError> {
    let mut builder = Response::builder().status(status).header(header::ACCEPT_RANGES, "bytes");
    if let Some(sha256) = &facts.sha256 {
        builder = builder.header(header::ETAG, format!("\"{sha256}\""));
        let raw: Vec<u8> =
            (0..sha256.len() / 2).filter_map(|k| u8::from_str_radix(&sha256[2 * k..2 * k + 2], 16).ok()).collect();
        let digest = base64::engine::general_purpose::STANDARD.encode(raw);
        builder = builder.header("repr-digest", format!("sha-256=:{digest}:"));
    }
    if status != StatusCode::NOT_MODIFIED {
        builder = builder.header(header::CONTENT_TYPE, &facts.media_type).header(header::CONTENT_LENGTH, length);
        if let Ok(name) =
            HeaderValue::from_str(&format!("inline; filename=\"{}\"", facts.name.replace(['"', '\\'], "_")))
        {
            builder = builder.header(header::CONTENT_DISPOSITION, name);
        }
    }
    if facts.sha256.is_some() || range.is_some() {
        builder = builder.extension(Verbatim);
    }
    if let Some(range) = range {
        builder = builder.header(header::CONTENT_RANGE, range);
    }
    builder.body(body).map_err(|error| ApiError::Internal(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::{FileFacts, Part, parse_range, part_of};
    use axum::http::{HeaderMap, HeaderValue};

    #[test]
    fn ranges_are_parsed_or_ignored() {
        assert_eq!(parse_range("bytes=0-9"), Some((Some(0), Some(9))));
        assert_eq!(parse_range("bytes=5-"), Some((Some(5), None)));
        assert_eq!(parse_range("bytes=-3"), Some((None, Some(3))));
        for ignored in ["bytes=9-3", "bytes=-", "lines=1-2", "bytes=1-2,4-5", "bytes=x-2"] {
            assert_eq!(parse_range(ignored), None, "{ignored}");
        }
    }

    #[test]
    fn parts_lie_inside_the_file() {
        let facts = FileFacts { sha256: Some("ab".into()), media_type: "x/y".into(), name: "n".into() };
        let part = |range: &str, size| {
            let mut headers = HeaderMap::new();
            headers.insert("range", HeaderValue::from_str(range).unwrap());
            part_of(&facts, &headers, size)
        };
        assert!(matches!(part("bytes=2-100", 10), Ok(Part::Range(2, 9))));
        assert!(matches!(part("bytes=-100", 10), Ok(Part::Range(0, 9))));
        assert!(part("bytes=10-", 10).is_err());
        assert!(part("bytes=-0", 10).is_err());
        assert!(part("bytes=0-", 0).is_err());
    }
}
