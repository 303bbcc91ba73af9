//! Pages of lists that inserts never shift, and plain parameters of a query.

use crate::error::{ApiError, ProblemItem};
use axum::Json;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use meniscus::scene::Violation;
use meniscus::scene::check::closest;
use serde::Serialize;
use serde_json::json;

/// Entries on a page when nothing is said, and at most.
const SIZE: (u64, u64) = (50, 500);

/// Which page.
#[derive(Debug, Clone)]
pub(crate) struct Page {
    /// Entries.
    pub(crate) limit: u64,
    /// Id of the last entry of the page before.
    pub(crate) cursor: Option<String>,
    query: Vec<(String, String)>,
}

impl Page {
    /// From a query that may have other parameters beside.
    pub(crate) fn of(query: &[(String, String)], others: &[&str]) -> Result<Self, ApiError> {
        let known: Vec<&str> = ["limit", "cursor"].iter().chain(others).copied().collect();
        refuse_unknown(query, &known)?;
        let limit = limit(query)?;
        let cursor = query.iter().rfind(|(name, _)| name == "cursor").map(|(_, value)| value.clone());
        Ok(Self { limit, cursor, query: query.to_vec() })
    }

    /// Cuts rows (one more than the page holds, where there is more) and links to the next page.
    pub(crate) fn answer<R, B: Serialize>(
        &self,
        path: &str,
        mut rows: Vec<R>,
        id: impl Fn(&R) -> String,
        body: impl FnOnce(Vec<R>, Option<String>) -> B,
    ) -> Response {
        let more = rows.len() as u64 > self.limit;
        rows.truncate(self.limit as usize);
        let next = rows.last().filter(|_| more).map(id);
        let link = next.as_ref().map(|cursor| next_link(path, &self.query, cursor));
        let mut response = Json(body(rows, next)).into_response();
        if let Some(link) = link.and_then(|link| HeaderValue::from_str(&link).ok()) {
            response.headers_mut().insert(header::LINK, link);
        }
        response
    }
}

fn limit(query: &[(String, String)]) -> Result<u64, ApiError> {
    match number(query, "limit")? {
        None => Ok(SIZE.0),
        Some(limit) if (1..=SIZE.1).contains(&limit) => Ok(limit),
        Some(limit) => {
            let allowed = json!(format!("1 to {}", SIZE.1));
            let violation = Violation::new("limit", "range", "a whole number is needed", &json!(limit), allowed);
            Err(ApiError::Invalid(vec![ProblemItem::from(violation)]))
        }
    }
}

fn next_link(path: &str, query: &[(String, String)], cursor: &str) -> String {
    let escape = |text: &str| {
        text.bytes()
            .map(|b| {
                if b.is_ascii_alphanumeric() || b"-._~".contains(&b) {
                    char::from(b).to_string()
                } else {
                    format!("%{b:02X}")
                }
            })
            .collect::<String>()
    };
    let mut parts: Vec<String> = query
        .iter()
        .filter(|(name, _)| name != "cursor")
        .map(|(name, value)| format!("{}={}", escape(name), escape(value)))
        .collect();
    parts.push(format!("cursor={}", escape(cursor)));
    format!("<{path}?{}>; rel=\"next\"", parts.join("&"))
}

/// Refuses parameters that nobody reads.
pub(crate) fn refuse_unknown(query: &[(String, String)], known: &[&str]) -> Result<(), ApiError> {
    let unknown = query.iter().filter(|(name, _)| !known.contains(&name.as_str()));
    let errors: Vec<ProblemItem> = unknown
        .map(|(name, value)| {
            let detail = "there is no such parameter";
            let mut violation = Violation::new(name.clone(), "unknown", detail, &json!(value), json!(known));
            violation.did_you_mean = closest(name, known);
            violation.into()
        })
        .collect();
    if errors.is_empty() { Ok(()) } else { Err(ApiError::Invalid(errors)) }
}

/// A whole number among the parameters.
pub(crate) fn number(query: &[(String, String)], name: &str) -> Result<Option<u64>, ApiError> {
    let Some((_, text)) = query.iter().rfind(|(key, _)| key == name) else { return Ok(None) };
    text.trim().parse::<u64>().map(Some).map_err(|_| {
        let allowed = json!("a whole number ≥ 0");
        let violation = Violation::new(name, "type", "a whole number is needed", &json!(text), allowed);
        ApiError::Invalid(vec![ProblemItem::from(violation)])
    })
}

/// True or false among the parameters.
pub(crate) fn flag(query: &[(String, String)], name: &str) -> Result<bool, ApiError> {
    match query.iter().rfind(|(key, _)| key == name).map(|(_, value)| value.as_str()) {
        None | Some("false") => Ok(false),
        Some("true") => Ok(true),
        Some(text) => {
            let violation = Violation::new(name, "type", "true or false", &json!(text), json!([true, false]));
            Err(ApiError::Invalid(vec![ProblemItem::from(violation)]))
        }
    }
}
