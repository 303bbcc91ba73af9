//! The path below which the service answers, where a proxy hands a part of its address space over.

use std::sync::OnceLock;

static BASE: OnceLock<String> = OnceLock::new();

/// Sets the base path, such as `/meniscus`, once before the service starts.
pub fn set(base: &str) {
    // A second start in one process keeps the first path.
    let _ = BASE.set(base.to_owned());
}

/// The base path; empty where the service has its address for itself.
#[must_use]
pub fn get() -> &'static str {
    BASE.get().map_or("", String::as_str)
}

/// The address of a path of the service.
#[must_use]
pub fn address(path: &str) -> String {
    format!("{}{path}", get())
}

/// A base path as given: it begins with a slash and does not end with one.
///
/// # Errors
/// What is wrong with it.
pub fn parse(text: &str) -> Result<String, String> {
    let trimmed = text.trim_end_matches('/');
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.~/".contains(c);
    if !trimmed.is_empty() && (!trimmed.starts_with('/') || trimmed.contains("//") || !trimmed.chars().all(is_plain)) {
        return Err(format!("--base-path {text} must be a path such as /meniscus, of letters, digits and -_.~"));
    }
    Ok(trimmed.to_owned())
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn base_paths_begin_with_a_slash_and_do_not_end_with_one() {
        assert_eq!(parse("/sim/meniscus/").as_deref(), Ok("/sim/meniscus"));
        assert_eq!(parse("/").as_deref(), Ok(""));
        for wrong in ["meniscus", "/a b", "//a", "/a?b"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
