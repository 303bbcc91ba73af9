//! Wall-clock time as clients see it: RFC 3339 in UTC, to the millisecond.

use jiff::Timestamp;

/// Now, such as `2026-11-22T01:39:32.123Z`.
#[must_use]
pub fn now() -> String {
    format!("{:.3}", Timestamp::now())
}

/// A time of a client, with any offset, in the form of [`now`]; None where it is none.
#[must_use]
pub fn parse(text: &str) -> Option<String> {
    text.parse::<Timestamp>().ok().map(|time| format!("{time:.3}"))
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn times_of_clients_compare_as_text() {
        assert_eq!(parse("2026-11-22T01:39:32Z").as_deref(), Some("2026-11-22T01:39:32.000Z"));
        assert_eq!(parse("2026-11-22T03:39:32.5+02:00").as_deref(), Some("2026-11-22T01:39:32.500Z"));
        assert_eq!(parse("yesterday"), None);
    }
}
