//! One thing that is wrong with a JSON body: where, what, and what would be accepted.

use serde_json::Value;

/// One thing that is wrong with a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Violation {
    /// JSON pointer to the place.
    pub pointer: String,
    /// A short word: `required`, `type`, `range`, `unknown`, `unknown_field`, `conflict`, …
    pub code: &'static str,
    /// What is wrong, as a sentence fragment.
    pub detail: String,
    /// The value found at the place.
    pub got: Value,
    /// What would be accepted.
    pub allowed: Value,
    /// A known name with a similar spelling.
    pub did_you_mean: Option<String>,
}

impl Violation {
    /// A violation without a suggestion.
    #[must_use]
    pub fn new(
        pointer: impl Into<String>,
        code: &'static str,
        detail: impl Into<String>,
        got: impl Into<Value>,
        allowed: impl Into<Value>,
    ) -> Self {
        Self {
            pointer: pointer.into(),
            code,
            detail: detail.into(),
            got: got.into(),
            allowed: allowed.into(),
            did_you_mean: None,
        }
    }

    /// A name that is not among the known ones; suggests the nearest spelling.
    #[must_use]
    pub fn unknown(
        pointer: impl Into<String>,
        code: &'static str,
        detail: impl Into<String>,
        got: impl Into<Value>,
        name: Option<&str>,
        known: &[&str],
    ) -> Self {
        let allowed = Value::from(known.to_vec());
        let did_you_mean = name.and_then(|name| suggest(name, known));
        Self { did_you_mean, ..Self::new(pointer, code, detail, got, allowed) }
    }

    /// The same violation with a prefix before its pointer.
    #[must_use]
    pub fn under(mut self, prefix: &str) -> Self {
        self.pointer.insert_str(0, prefix);
        self
    }
}

/// The known name nearest in spelling to `name`, if one is near.
#[must_use]
pub fn suggest(name: &str, known: &[&str]) -> Option<String> {
    known
        .iter()
        .map(|candidate| (strsim::damerau_levenshtein(name, candidate), *candidate))
        .filter(|(distance, candidate)| *distance <= 1 + candidate.len().min(name.len()) / 4)
        .min()
        .map(|(_, candidate)| candidate.to_owned())
}

/// A name escaped for use in a JSON pointer (RFC 6901).
#[must_use]
pub fn escape(name: &str) -> String {
    name.replace('~', "~0").replace('/', "~1")
}

#[cfg(test)]
mod tests {
    use super::{escape, suggest};

    #[test]
    fn near_spellings_are_suggested_and_far_ones_are_not() {
        let known = ["spacing", "band_h", "shape"];
        assert_eq!(suggest("spacign", &known).as_deref(), Some("spacing"));
        assert_eq!(suggest("bandh", &known).as_deref(), Some("band_h"));
        assert_eq!(suggest("viscosity", &known), None);
    }

    #[test]
    fn pointers_escape_their_own_signs() {
        assert_eq!(escape("a/b~c"), "a~1b~0c");
    }
}
