//! Every type of problem that the API answers with: its status code, its title, and what a client can do about it.
//!
//! A problem's `type` is `/problems/KIND`, where `GET` answers the text of the type.

use axum::http::StatusCode;

/// A type of problem.
#[derive(Debug, PartialEq, Eq)]
pub struct ProblemType {
    /// Last part of the URI `/problems/KIND`.
    pub kind: &'static str,
    /// Status code of the answer.
    pub status: StatusCode,
    /// One line that is the same for every problem of this type.
    pub title: &'static str,
    /// When the problem occurs, and what to do.
    pub explanation: &'static str,
}

impl ProblemType {
    /// The type with this kind.
    #[must_use]
    pub fn find(kind: &str) -> Option<&'static Self> {
        ALL.iter().copied().find(|known| known.kind == kind)
    }

    /// Title, status code and explanation as plain text.
    #[must_use]
    pub fn text(&self) -> String {
        format!("{}\n\nStatus: {}\n\n{}\n", self.title, self.status, self.explanation)
    }
}

macro_rules! problem_types {
    ($($name:ident = $kind:literal, $status:ident, $title:literal, $explanation:literal;)*) => {
        $(
            #[doc = $title]
            pub static $name: ProblemType = ProblemType {
                kind: $kind,
                status: StatusCode::$status,
                title: $title,
                explanation: $explanation,
            };
        )*

        /// Every type of problem.
        pub static ALL: &[&ProblemType] = &[$(&$name,)*];
    };
}

problem_types! {
    UNPARSABLE = "unparsable", BAD_REQUEST, "The body is not valid JSON",
        "The body must be one JSON value in UTF-8. Names of fields must not repeat within an object. NaN, infinity and \
         numbers beyond the range of 64-bit floating point are not allowed. The detail says where reading stopped.";
    BAD_REQUEST = "bad-request", BAD_REQUEST, "The path or the query cannot be read",
        "Percent-encoded characters of the path must be valid UTF-8. Check how the client encodes the address.";
    INVALID = "invalid", UNPROCESSABLE_ENTITY, "The request is not valid",
        "The request can be read, but values in it are wrong. `errors` lists all of them. `pointer` is the JSON pointer \
         to the value, or the name of the query parameter or header. `allowed` says what is accepted.";
    NOT_FOUND = "not-found", NOT_FOUND, "Not found",
        "Nothing exists at this address. Check the spelling of the id or the path. The object may have been deleted. \
         GET /v1 links to the lists of all objects.";
    METHOD_NOT_ALLOWED = "method-not-allowed", METHOD_NOT_ALLOWED, "The method is not allowed here",
        "The address exists, but not with this method. GET /openapi.json lists the methods of every address.";
    CONFLICT = "conflict", CONFLICT, "The state does not allow this",
        "The object is in a state in which the request makes no sense, or other objects use it. The detail names the \
         state and what to do first.";
    TOO_LARGE = "too-large", PAYLOAD_TOO_LARGE, "The body is too large",
        "The body has more bytes than the service accepts. GET /v1 lists the limits. The operator sets the limit of \
         uploads with --upload-bytes.";
    UNSUPPORTED_MEDIA = "unsupported-media", UNSUPPORTED_MEDIA_TYPE, "The body has a media type that is not accepted",
        "An upload is the bytes of one file, without a form around them: curl --data-binary @FILE.";
    UNSUPPORTED_ENCODING = "unsupported-encoding", UNSUPPORTED_MEDIA_TYPE, "The body has an encoding that is not accepted",
        "A body is sent as it is, or compressed by gzip with the header Content-Encoding: gzip.";
    NOT_OWNER = "not-owner", FORBIDDEN, "The object belongs to another client",
        "With tokens, jobs, studies and uploads belong to the token that made them. Others may read them. To change what others \
         made, a token needs the scope admin.";
    CHANGED = "changed", PRECONDITION_FAILED, "The object was changed in the meantime",
        "The header If-Match names another revision than the object has now.";
    RANGE = "range", RANGE_NOT_SATISFIABLE, "The range lies outside the file",
        "No byte of the requested range exists. The Content-Range header of the answer has the size of the file.";
    UNAUTHORIZED = "unauthorized", UNAUTHORIZED, "A token is needed",
        "The request carries no token, or an unknown one. Send the header `Authorization: Bearer TOKEN`. The operator \
         makes tokens with `meniscus token NAME`.";
    FORBIDDEN = "forbidden", FORBIDDEN, "The token does not allow this",
        "The token lacks a scope. The detail names it. The scopes are read, submit, control and admin; the operator makes \
         tokens with other scopes with `meniscus token NAME --scopes LIST`.";
    UNKNOWN_HOST = "unknown-host", MISDIRECTED_REQUEST, "The service does not answer under this host name",
        "The service answers under localhost, the address that it listens on, and the names that the operator allows \
         with --allow-host NAME.";
    FOREIGN_ORIGIN = "foreign-origin", FORBIDDEN, "Requests from pages of other origins are not allowed",
        "The Origin header names a page that is not the service's own. The operator allows origins with \
         --allow-origin ORIGIN.";
    TOO_MANY = "too-many", TOO_MANY_REQUESTS, "Too many objects were created in the last minute",
        "The service limits the jobs, studies and uploads that a client creates per minute. Wait for the seconds in \
         the Retry-After header. The operator sets the limit with --creations-per-minute.";
    QUOTA = "quota", TOO_MANY_REQUESTS, "Too many jobs are unfinished",
        "The service limits the number of unfinished jobs. Wait until jobs end, or cancel some. The operator sets the \
         limit with --most-unfinished.";
    NO_SPACE = "no-space", INSUFFICIENT_STORAGE, "There is not enough disk space",
        "The files would not fit on the disk beside the reserve. Fewer frames (/output/every_time), fewer checkpoints \
         (/checkpoint/keep) or a larger spacing need less space. Deleting jobs frees space.";
    DISK_FULL = "disk-full", INSUFFICIENT_STORAGE, "The disk is full",
        "Nothing can be written until space is free. Existing results can still be read. Jobs that paused because of \
         missing space continue by themselves.";
    NOT_READY = "not-ready", SERVICE_UNAVAILABLE, "The service is starting or stopping",
        "After a start the service recovers its jobs before it accepts requests. Try again after the seconds in the \
         Retry-After header. GET /readyz answers 200 as soon as the service is ready.";
    UNWRITABLE = "unwritable", SERVICE_UNAVAILABLE, "The service cannot write its data directory",
        "The disk is full, read-only or failing. Nothing new can be promised until it can be written again; what is there can \
         be read.";
    INTERNAL = "internal", INTERNAL_SERVER_ERROR, "The service failed",
        "An error of the service or of its disk, not of the request. The operator finds the cause in the log under the \
         id in the X-Request-Id header.";
}

#[cfg(test)]
mod tests {
    use super::{ALL, ProblemType};

    #[test]
    fn kinds_are_unique_and_found() {
        for known in ALL {
            assert_eq!(ProblemType::find(known.kind), Some(*known));
        }
        assert!(ProblemType::find("nothing").is_none());
    }
}
