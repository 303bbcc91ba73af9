//! What every request and every answer passes through, one file a layer.

pub mod access;
pub mod encoding;
pub mod readiness;
pub mod request_id;
pub mod request_log;
pub mod security_headers;
