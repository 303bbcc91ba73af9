//! Wall-clock time as clients see it: RFC 3339 in UTC, to the millisecond.

use jiff::Timestamp;

/// Now, such as `2026-11-22T01:39:32.123Z`.
#[must_use]
pub fn now() -> String {
    format!("{:.3}", Timestamp::now())
}
