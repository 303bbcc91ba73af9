//! Choice between two media types by the `Accept` header.

use axum::http::{HeaderMap, header};

/// Whether a client asks for `kind` and not for `other`, by parts of the names of media types.
#[must_use]
pub fn prefers(headers: &HeaderMap, kind: &str, other: &str) -> bool {
    let accept = headers.get(header::ACCEPT).and_then(|value| value.to_str().ok());
    accept.is_some_and(|accept| accept.contains(kind) && !accept.contains(other))
}

#[cfg(test)]
mod tests {
    use super::prefers;
    use axum::http::{HeaderMap, HeaderValue};

    #[test]
    fn the_default_is_kept_unless_the_other_type_alone_is_asked_for() {
        let with = |accept: &'static str| {
            HeaderMap::from_iter([("accept".parse().unwrap(), HeaderValue::from_static(accept))])
        };
        assert!(prefers(&with("application/json"), "json", "text/csv"));
        assert!(!prefers(&with("text/csv, application/json"), "json", "text/csv"));
        assert!(!prefers(&with("*/*"), "json", "text/csv") && !prefers(&HeaderMap::new(), "json", "text/csv"));
    }
}
