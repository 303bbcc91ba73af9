//! Errors of requests, and the only place that turns them into answers (RFC 9457 problems).
//!
//! Which error to use where:
//! - [`ApiError::Unparsable`] if a body is no JSON, [`ApiError::BadRequest`] if a path or query is no text (400);
//! - [`ApiError::Invalid`] if a request can be read but says something wrong: collect all that is wrong first (422);
//! - [`ApiError::NotFound`] if an object that the path names does not exist (404). An id in a *body* that does not
//!   exist is [`ApiError::Invalid`];
//! - [`ApiError::Conflict`] if the object exists, but its state forbids the request (409);
//! - [`ApiError::TooMany`], [`ApiError::QuotaReached`], [`ApiError::NoSpace`] if a limit forbids it now (429, 507);
//! - [`ApiError::Internal`] for everything that is not the client's fault. `?` on errors of the store and of the system
//!   leads there, except that a full disk becomes [`ApiError::DiskFull`].
//!
//! Status codes, titles and explanations stand in [`crate::problems`].

use crate::base_path::address;
use crate::problems::{self, ProblemType};
use crate::rate_limit::Budget;
use axum::Json;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use meniscus::spec::Violation;
use meniscus_jobs::service::store::{ChangeError, StoreError};
use meniscus_jobs::spec::body::BodyError;
use meniscus_jobs::system::process;
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

/// An `application/problem+json` body.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Problem {
    /// Type of the problem as a relative URI. `GET` answers its explanation.
    pub r#type: String,
    /// Title of the type.
    pub title: String,
    /// Status code of the answer.
    pub status: u16,
    /// What is wrong with this request.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detail: Option<String>,
    /// Every single error of a body or a query.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<ProblemItem>,
}

/// One error of a body, a query parameter or a header.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ProblemItem {
    /// JSON pointer to the value, or the name of a query parameter or header.
    pub pointer: String,
    /// Code of the error for programs, such as `required`, `type`, `range` or `unknown`.
    pub code: String,
    /// What is wrong, for people.
    pub detail: String,
    /// The value as received.
    pub got: Value,
    /// What is accepted.
    pub allowed: Value,
    /// A known name with a similar spelling.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub did_you_mean: Option<String>,
}

impl From<Violation> for ProblemItem {
    fn from(v: Violation) -> Self {
        let Violation { pointer, code, detail, got, allowed, did_you_mean } = v;
        Self { pointer, code: code.to_owned(), detail, got, allowed, did_you_mean }
    }
}

/// Any error of a request.
#[derive(Debug)]
pub enum ApiError {
    /// The body is not JSON; the text says where and why.
    Unparsable(String),
    /// The body, the query or a header has wrong values.
    Invalid(Vec<ProblemItem>),
    /// The object that the path names does not exist; the text is its noun.
    NotFound(&'static str),
    /// The path or the query is not UTF-8.
    BadRequest,
    /// The files would not fit on the disk.
    NoSpace {
        /// Bytes that will be written.
        needed: u64,
        /// Bytes that are free beyond the reserve.
        free: u64,
    },
    /// The disk is full.
    DiskFull,
    /// The path exists, but not with this method.
    MethodNotAllowed,
    /// The state of the object forbids the request; the text names the state and what to do.
    Conflict(String),
    /// The body has more than this many bytes.
    TooLarge(u64),
    /// The body has a media type that is not accepted.
    UnsupportedMedia,
    /// The body has a content encoding that is not accepted.
    UnsupportedEncoding,
    /// The object belongs to another client; the text is its name.
    NotOwner(String),
    /// The object has another revision than the one that the change was made for.
    Changed,
    /// The request carries no token, or an unknown one.
    Unauthorized,
    /// The token lacks this scope.
    Forbidden(&'static str),
    /// The `Host` header names an unknown host.
    UnknownHost,
    /// The `Origin` header names another host.
    ForeignOrigin,
    /// The client has no creation left in this minute.
    TooMany(Budget),
    /// Too many jobs are unfinished.
    QuotaReached {
        /// Unfinished jobs.
        unfinished: u64,
        /// Most unfinished jobs that are allowed.
        most: u64,
    },
    /// The requested range lies outside a file of this many bytes.
    RangeNotSatisfiable(u64),
    /// The service is starting or stopping.
    NotReady,
    /// The data directory cannot be written.
    Unwritable,
    /// A defect or a failing disk. The text goes to the log, never to the client.
    Internal(String),
}

impl ApiError {
    /// One wrong value that is neither missing nor misspelled.
    #[must_use]
    pub fn invalid(pointer: &str, code: &'static str, detail: &str, got: &Value, allowed: Value) -> Self {
        Self::Invalid(vec![Violation::new(pointer, code, detail, got.clone(), allowed).into()])
    }

    fn problem_type(&self) -> &'static ProblemType {
        match self {
            Self::Unparsable(_) => &problems::UNPARSABLE,
            Self::Invalid(_) => &problems::INVALID,
            Self::NotFound(_) => &problems::NOT_FOUND,
            Self::BadRequest => &problems::BAD_REQUEST,
            Self::NoSpace { .. } => &problems::NO_SPACE,
            Self::DiskFull => &problems::DISK_FULL,
            Self::MethodNotAllowed => &problems::METHOD_NOT_ALLOWED,
            Self::Conflict(_) => &problems::CONFLICT,
            Self::TooLarge(_) => &problems::TOO_LARGE,
            Self::UnsupportedMedia => &problems::UNSUPPORTED_MEDIA,
            Self::UnsupportedEncoding => &problems::UNSUPPORTED_ENCODING,
            Self::NotOwner(_) => &problems::NOT_OWNER,
            Self::Changed => &problems::CHANGED,
            Self::Unauthorized => &problems::UNAUTHORIZED,
            Self::Forbidden(_) => &problems::FORBIDDEN,
            Self::UnknownHost => &problems::UNKNOWN_HOST,
            Self::ForeignOrigin => &problems::FOREIGN_ORIGIN,
            Self::TooMany(_) => &problems::TOO_MANY,
            Self::QuotaReached { .. } => &problems::QUOTA,
            Self::RangeNotSatisfiable(_) => &problems::RANGE,
            Self::NotReady => &problems::NOT_READY,
            Self::Unwritable => &problems::UNWRITABLE,
            Self::Internal(_) => &problems::INTERNAL,
        }
    }

    /// What is wrong with this request, with numbers and names. None where the title says everything.
    fn detail(&self) -> Option<String> {
        Some(match self {
            Self::Unparsable(detail) | Self::Conflict(detail) => detail.clone(),
            Self::Invalid(items) if items.len() == 1 => "1 validation error".to_owned(),
            Self::Invalid(items) => format!("{} validation errors", items.len()),
            Self::NotFound(noun) => format!("No {noun} was found at this address."),
            Self::NoSpace { needed, free } => format!(
                "About {needed} bytes are needed, {free} are free. Fewer frames (/output/every_time), fewer checkpoints (/checkpoint/keep) or a larger spacing need less."
            ),
            Self::DiskFull => "Existing results can be read. Paused jobs continue when space is free.".to_owned(),
            Self::TooLarge(limit) => format!("At most {limit} bytes are accepted."),
            Self::UnsupportedMedia => "Send the bytes of the file: curl --data-binary @FILE.".to_owned(),
            Self::UnsupportedEncoding => "Send the body as it is, or compressed by gzip.".to_owned(),
            Self::NotOwner(owner) => format!("It belongs to {owner}."),
            Self::Changed => "Read the object again, and repeat the change with its present ETag.".to_owned(),
            Self::Unauthorized => "Send the header Authorization: Bearer TOKEN.".to_owned(),
            Self::Forbidden(scope) => format!("The scope {scope} is needed."),
            Self::UnknownHost => "The operator allows host names with --allow-host NAME.".to_owned(),
            Self::ForeignOrigin => "The operator allows origins with --allow-origin ORIGIN.".to_owned(),
            Self::TooMany(budget) => {
                format!("{} creations per minute are allowed. Try again in {} s.", budget.quota, budget.next_s)
            }
            Self::QuotaReached { unfinished, most } => {
                format!("{unfinished} jobs are unfinished, {most} are allowed. Wait until jobs end, or cancel some.")
            }
            Self::RangeNotSatisfiable(size) => format!("The file has {size} bytes."),
            Self::Unwritable => "Existing jobs and files can be read. The log of the service has the cause.".to_owned(),
            Self::BadRequest | Self::MethodNotAllowed | Self::NotReady | Self::Internal(_) => return None,
        })
    }

    /// Headers that clients need beside the body.
    fn write_headers(&self, status: StatusCode, headers: &mut HeaderMap) {
        let mut put = |name: HeaderName, text: String| {
            if let Ok(value) = HeaderValue::from_str(&text) {
                headers.insert(name, value);
            }
        };
        put(header::CONTENT_TYPE, "application/problem+json".to_owned());
        match self {
            Self::UnsupportedEncoding => put(header::ACCEPT_ENCODING, "gzip, identity".to_owned()),
            Self::Unauthorized => put(header::WWW_AUTHENTICATE, "Bearer realm=\"meniscus\"".to_owned()),
            Self::Forbidden(scope) => {
                let challenge = format!("Bearer realm=\"meniscus\", error=\"insufficient_scope\", scope=\"{scope}\"");
                put(header::WWW_AUTHENTICATE, challenge);
            }
            Self::RangeNotSatisfiable(size) => put(header::CONTENT_RANGE, format!("bytes */{size}")),
            _ => {}
        }
        match (self, status) {
            (Self::TooMany(budget), _) => {
                put(header::RETRY_AFTER, budget.next_s.to_string());
                budget.write(headers);
            }
            (_, StatusCode::TOO_MANY_REQUESTS) => put(header::RETRY_AFTER, "60".to_owned()),
            (_, StatusCode::SERVICE_UNAVAILABLE) => put(header::RETRY_AFTER, "1".to_owned()),
            _ => {}
        }
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        if let Self::Internal(cause) = &self {
            // Logged once, here. The client learns no path, no SQL and no backtrace.
            tracing::error!(cause, "request failed");
        }
        let &ProblemType { kind, status, title, .. } = self.problem_type();
        let mut headers = HeaderMap::new();
        self.write_headers(status, &mut headers);
        let detail = self.detail();
        let errors = if let Self::Invalid(items) = self { items } else { Vec::new() };
        let body = Problem {
            r#type: address(&format!("/problems/{kind}")),
            title: title.to_owned(),
            status: status.as_u16(),
            detail,
            errors,
        };
        (status, headers, Json(body)).into_response()
    }
}
impl From<BodyError<StoreError>> for ApiError {
    fn from(error: BodyError<StoreError>) -> Self {
        match error {
            BodyError::Invalid(violations) => violations.into(),
            BodyError::Lookup(error) => error.into(),
        }
    }
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::CheckpointGone => Self::invalid(
                "/restart/checkpoint",
                "not_found",
                "the checkpoint was deleted",
                &Value::Null,
                "the id of a checkpoint, ckpt_…".into(),
            ),
            StoreError::UploadGone => {
                Self::Conflict("An upload that the scene names was deleted. Upload the file again.".to_owned())
            }
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
            ChangeError::Illegal(state, trigger) => {
                Self::Conflict(format!("The job is {} and cannot {} in this state.", state.word(), trigger.word()))
            }
            ChangeError::Stale => {
                Self::Conflict("Another request changed the job at the same moment. Try again.".to_owned())
            }
            ChangeError::Store(error) => error.into(),
        }
    }
}

impl From<Vec<Violation>> for ApiError {
    fn from(violations: Vec<Violation>) -> Self {
        Self::Invalid(violations.into_iter().map(ProblemItem::from).collect())
    }
}
