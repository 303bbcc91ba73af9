//! Errors as RFC 9457 problems: the only mapping from what went wrong to a status code.

use crate::access::{Budget, Scope};
use axum::Json;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use meniscus::scene::Violation;
use meniscus_jobs::service::store::{ChangeError, StoreError};
use meniscus_jobs::system::process;
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

/// An `application/problem+json` body.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Problem {
    /// A word for programs, as a relative URI.
    pub r#type: String,
    /// A title for people.
    pub title: String,
    /// The status code.
    pub status: u16,
    /// What is wrong here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detail: Option<String>,
    /// Every single thing that is wrong with a body or a query.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<ProblemItem>,
}

/// One thing wrong with a body.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ProblemItem {
    /// JSON pointer to the place, or the name of a query parameter.
    pub pointer: String,
    /// A word for programs.
    pub code: String,
    /// A sentence fragment for people.
    pub detail: String,
    /// What stands there.
    pub got: Value,
    /// What would be accepted.
    pub allowed: Value,
    /// A known name spelled alike.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub did_you_mean: Option<String>,
}

impl From<Violation> for ProblemItem {
    fn from(v: Violation) -> Self {
        let Violation { pointer, code, detail, got, allowed, did_you_mean } = v;
        Self { pointer, code: code.to_owned(), detail, got, allowed, did_you_mean }
    }
}

/// Whatever a handler can fail with.
#[derive(Debug)]
pub enum ApiError {
    /// The body is not JSON as it must be.
    Unparsable(String),
    /// The body or query says things that cannot be.
    Invalid(Vec<ProblemItem>),
    /// Nothing is there.
    NotFound(&'static str),
    /// The path or the query is not text as it must be.
    BadRequest,
    /// The files of a job would not fit.
    NoSpace {
        /// Bytes that it will write.
        needed: u64,
        /// Bytes that are free beyond the reserve.
        room: u64,
    },
    /// Nothing can be written any more.
    DiskFull,
    /// Too many of the same are under way.
    Busy,
    /// The path exists, the method does not.
    MethodNotAllowed,
    /// The state does not allow it.
    Conflict(String),
    /// The body is larger than this many bytes.
    TooLarge(u64),
    /// The body is of a kind that is not taken.
    UnsupportedMedia,
    /// No token, or none that is known.
    Unauthorized,
    /// The token has not this scope.
    Forbidden(Scope),
    /// The service does not answer under this name.
    UnknownHost,
    /// A page of another origin asks.
    ForeignOrigin,
    /// The client has made as much as it may in this minute.
    TooMany(Budget),
    /// As many jobs are unfinished as may be.
    QuotaReached {
        /// So many are.
        unfinished: u64,
        /// So many may be.
        most: u64,
    },
    /// No byte of the range exists in a file of this size.
    RangeNotSatisfiable(u64),
    /// Not yet, or not any more.
    NotReady,
    /// A defect or a failing disk; the log says more than the client learns.
    Internal(String),
}

impl ApiError {
    fn problem(&self) -> (StatusCode, &'static str, &'static str, Option<String>) {
        match self {
            Self::Unparsable(detail) => {
                (StatusCode::BAD_REQUEST, "unparsable", "the body is not valid JSON", Some(detail.clone()))
            }
            Self::Invalid(items) => {
                let detail = format!("{} thing{} wrong", items.len(), if items.len() == 1 { " is" } else { "s are" });
                (StatusCode::UNPROCESSABLE_ENTITY, "invalid", "the request is not valid", Some(detail))
            }
            Self::NotFound(what) => {
                (StatusCode::NOT_FOUND, "not-found", "not found", Some(format!("there is no such {what}")))
            }
            Self::BadRequest => (StatusCode::BAD_REQUEST, "bad-request", "the path or the query cannot be read", None),
            Self::NoSpace { needed, room } => {
                let detail = format!(
                    "the job will write about {needed} bytes, {room} are free: fewer frames (/output/every_time), fewer checkpoints (/checkpoint/keep) or a larger spacing need less"
                );
                (StatusCode::INSUFFICIENT_STORAGE, "no-space", "the files of this job would not fit", Some(detail))
            }
            Self::DiskFull => (
                StatusCode::INSUFFICIENT_STORAGE,
                "disk-full",
                "the disk is full",
                Some("what is there can be read; jobs that rest for want of space go on by themselves".to_owned()),
            ),
            Self::Busy => (StatusCode::SERVICE_UNAVAILABLE, "busy", "too many of these are under way", None),
            Self::MethodNotAllowed => {
                (StatusCode::METHOD_NOT_ALLOWED, "method-not-allowed", "this resource does not do that", None)
            }
            Self::Conflict(detail) => {
                (StatusCode::CONFLICT, "conflict", "the state does not allow that", Some(detail.clone()))
            }
            Self::TooLarge(limit) => (
                StatusCode::PAYLOAD_TOO_LARGE,
                "too-large",
                "the body is too large",
                Some(format!("at most {limit} bytes")),
            ),
            Self::UnsupportedMedia => (
                StatusCode::UNSUPPORTED_MEDIA_TYPE,
                "unsupported-media",
                "the body is not taken in this form",
                Some("send the bytes of the file themselves (curl --data-binary @FILE)".to_owned()),
            ),
            Self::Unauthorized => (
                StatusCode::UNAUTHORIZED,
                "unauthorized",
                "a token is needed",
                Some("Authorization: Bearer TOKEN".to_owned()),
            ),
            Self::Forbidden(scope) => (
                StatusCode::FORBIDDEN,
                "forbidden",
                "the token does not allow that",
                Some(format!("the scope {} is needed", scope.word())),
            ),
            Self::UnknownHost => (
                StatusCode::MISDIRECTED_REQUEST,
                "unknown-host",
                "the service does not answer under this name",
                Some("the operator adds names by --allow-host".to_owned()),
            ),
            Self::ForeignOrigin => (
                StatusCode::FORBIDDEN,
                "foreign-origin",
                "pages of other origins are not answered",
                Some("the operator adds names by --allow-host".to_owned()),
            ),
            Self::TooMany(budget) => (
                StatusCode::TOO_MANY_REQUESTS,
                "too-many",
                "too much was made in this minute",
                Some(format!("{} a minute are allowed", budget.quota)),
            ),
            Self::QuotaReached { unfinished, most } => (
                StatusCode::TOO_MANY_REQUESTS,
                "quota",
                "too many jobs are unfinished",
                Some(format!("{unfinished} are, {most} may be")),
            ),
            Self::RangeNotSatisfiable(size) => {
                let detail = Some(format!("the file has {size} bytes"));
                (StatusCode::RANGE_NOT_SATISFIABLE, "range", "no byte of that range exists", detail)
            }
            Self::NotReady => {
                (StatusCode::SERVICE_UNAVAILABLE, "not-ready", "the service is starting or stopping", None)
            }
            Self::Internal(_) => (StatusCode::INTERNAL_SERVER_ERROR, "internal", "the service failed", None),
        }
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let (status, kind, title, detail) = self.problem();
        if let Self::Internal(cause) = &self {
            // Logged once, here; the client gets no path, no SQL, no backtrace.
            tracing::error!(cause, "request failed");
        }
        let range = if let Self::RangeNotSatisfiable(size) = &self { Some(*size) } else { None };
        let budget = if let Self::TooMany(budget) = &self { Some(*budget) } else { None };
        let challenge = match &self {
            Self::Unauthorized => Some("Bearer realm=\"meniscus\"".to_owned()),
            Self::Forbidden(scope) => {
                Some(format!("Bearer realm=\"meniscus\", error=\"insufficient_scope\", scope=\"{}\"", scope.word()))
            }
            _ => None,
        };
        let errors = if let Self::Invalid(items) = self { items } else { Vec::new() };
        let body = Problem {
            r#type: format!("/problems/{kind}"),
            title: title.to_owned(),
            status: status.as_u16(),
            detail,
            errors,
        };
        let mut response = (status, Json(body)).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        let wait = match (status, budget) {
            (_, Some(budget)) => {
                budget.write(headers);
                Some(budget.next_s)
            }
            (StatusCode::TOO_MANY_REQUESTS, None) => Some(60),
            (StatusCode::SERVICE_UNAVAILABLE, None) => Some(1),
            _ => None,
        };
        if let Some(wait) = wait {
            headers.insert(header::RETRY_AFTER, HeaderValue::from(wait));
        }
        if let Some(challenge) = challenge.and_then(|text| HeaderValue::from_str(&text).ok()) {
            headers.insert(header::WWW_AUTHENTICATE, challenge);
        }
        if let Some(value) = range.and_then(|size| HeaderValue::from_str(&format!("bytes */{size}")).ok()) {
            headers.insert(header::CONTENT_RANGE, value);
        }
        response
    }
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::CheckpointGone => Self::Invalid(vec![ProblemItem {
                pointer: "/restart/checkpoint".to_owned(),
                code: "not_found".to_owned(),
                detail: error.to_string(),
                got: Value::Null,
                allowed: "the id of a checkpoint, ckpt_…".into(),
                did_you_mean: None,
            }]),
            StoreError::UploadGone => Self::Conflict("an upload was deleted while it was to be used".to_owned()),
            error if process::is_out_of_space(&error) => Self::DiskFull,
            error => Self::Internal(error.to_string()),
        }
    }
}

impl From<std::io::Error> for ApiError {
    fn from(error: std::io::Error) -> Self {
        if process::is_out_of_space(&error) { Self::DiskFull } else { Self::Internal(error.to_string()) }
    }
}

impl From<tokio::task::JoinError> for ApiError {
    fn from(error: tokio::task::JoinError) -> Self {
        Self::Internal(error.to_string())
    }
}

impl From<ChangeError> for ApiError {
    fn from(error: ChangeError) -> Self {
        match error {
            ChangeError::NotFound => Self::NotFound("job"),
            ChangeError::Illegal(..) | ChangeError::Stale => Self::Conflict(error.to_string()),
            ChangeError::Store(error) => error.into(),
        }
    }
}

impl From<Vec<Violation>> for ApiError {
    fn from(violations: Vec<Violation>) -> Self {
        Self::Invalid(violations.into_iter().map(ProblemItem::from).collect())
    }
}
