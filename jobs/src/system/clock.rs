//! Wall-clock time as clients see it: RFC 3339 in UTC, to the millisecond. The clock may be set while the service runs:
//! nothing but what is shown, and how long things are kept, depends on it.

use jiff::{SignedDuration, Timestamp};

/// The present time. Tests set the clock of a build with debug assertions by the seconds in the file that
/// `MENISCUS_CLOCK_OFFSET_FILE` names.
fn present() -> Timestamp {
    let now = Timestamp::now();
    if !cfg!(debug_assertions) {
        return now;
    }
    let offset = std::env::var_os("MENISCUS_CLOCK_OFFSET_FILE")
        .and_then(|file| std::fs::read_to_string(file).ok()?.trim().parse::<i64>().ok());
    now.checked_add(SignedDuration::from_secs(offset.unwrap_or(0))).unwrap_or(now)
}

/// Now, such as `2026-11-22T01:39:32.123Z`.
#[must_use]
pub fn now() -> String {
    format!("{:.3}", present())
}

/// Milliseconds since 1970.
#[must_use]
pub fn milliseconds() -> u64 {
    u64::try_from(present().as_millisecond()).unwrap_or(0)
}

/// The time so many seconds from now (before now, where negative).
#[must_use]
pub fn from_now(seconds: i64) -> String {
    let now = present();
    format!("{:.3}", now.checked_add(SignedDuration::from_secs(seconds)).unwrap_or(now))
}

/// A time of a client, with any offset, in the form of [`now`]; None where it is none.
#[must_use]
pub fn parse(text: &str) -> Option<String> {
    text.parse::<Timestamp>().ok().map(|time| format!("{time:.3}"))
}

#[cfg(test)]
mod tests {
    use super::{from_now, now, parse};

    #[test]
    fn times_of_clients_compare_as_text() {
        assert_eq!(parse("2026-11-22T01:39:32Z").as_deref(), Some("2026-11-22T01:39:32.000Z"));
        assert_eq!(parse("2026-11-22T03:39:32.5+02:00").as_deref(), Some("2026-11-22T01:39:32.500Z"));
        assert_eq!(parse("yesterday"), None);
        assert!(from_now(-60) < now() && now() < from_now(60));
    }
}
