//! Query parameters as typed structs, with all errors at once.
//!
//! A handler takes `QueryParameters<T>`, where `T` derives `Deserialize` and `IntoParams`: the struct is the only declaration of
//! its parameters. `T` needs `#[serde(deny_unknown_fields)]`. Rules for the text of a query:
//! - of a parameter that is given twice, the last one counts;
//! - a list takes values separated by commas, and may be given several times;
//! - parameters `NAME.x=1`, `NAME.y=2` are the entries of a map with the name `NAME.KEY`.
//!
//! Serde stops at the first error. So a value that is refused is taken out, and the rest is read again, until nothing is
//! wrong any more.

mod values;

use crate::error::{ApiError, ProblemItem};
use axum::extract::{FromRequestParts, Query as RawQuery};
use axum::http::request::Parts;
use meniscus::spec::suggest;
use serde::de::{DeserializeOwned, Expected, Unexpected};
use serde_json::{Value, json};
use std::fmt::{self, Display};
use values::Parameters;

/// The query parameters of a request.
#[derive(Debug, Clone)]
pub struct QueryParameters<T>(pub T);

impl<S: Sync, T: DeserializeOwned> FromRequestParts<S> for QueryParameters<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, ApiError> {
        let RawQuery(pairs) = RawQuery::try_from_uri(&parts.uri).map_err(|_| ApiError::BadRequest)?;
        parse(pairs).map(Self).map_err(ApiError::Invalid)
    }
}

/// A parameter as it stands in the query.
#[derive(Debug, Clone)]
struct Pair {
    name: String,
    text: String,
}

/// Reads pairs of names and texts as a struct.
///
/// # Errors
/// All that is wrong with them.
pub fn parse<T: DeserializeOwned>(pairs: Vec<(String, String)>) -> Result<T, Vec<ProblemItem>> {
    let mut pairs: Vec<Pair> = pairs.into_iter().map(|(name, text)| Pair { name, text }).collect();
    let mut errors: Vec<ProblemItem> = Vec::new();
    loop {
        let refusal = match T::deserialize(Parameters::new(&pairs)) {
            Ok(value) if errors.is_empty() => return Ok(value),
            Ok(_) => return Err(errors),
            Err(refusal) => refusal,
        };
        let Some(place) = refusal.place.clone() else {
            let is_known = errors.iter().any(|error| error.pointer == refusal.name);
            if !is_known {
                let allowed = allowed_of::<T>(&pairs, &refusal.name);
                errors.push(ProblemItem { allowed, ..refusal.into_item() });
            }
            return Err(errors);
        };
        take_out(&mut pairs, &place);
        errors.push(refusal.into_item());
    }
}

/// Takes a refused text out: a whole parameter, or one value of a list.
fn take_out(pairs: &mut Vec<Pair>, place: &Place) {
    let pair = &mut pairs[place.pair];
    let kept: Vec<&str> = pair.text.split(',').filter(|piece| *piece != place.text).collect();
    if pair.text == place.text || kept.is_empty() || kept.len() == pair.text.split(',').count() {
        pairs.remove(place.pair);
    } else {
        pair.text = kept.join(",");
    }
}

/// What a missing parameter may be: an empty text for it is refused with that answer.
fn allowed_of<T: DeserializeOwned>(pairs: &[Pair], name: &str) -> Value {
    let mut pairs = pairs.to_vec();
    pairs.push(Pair { name: name.to_owned(), text: String::new() });
    T::deserialize(Parameters::new(&pairs)).err().map_or(Value::Null, |refusal| refusal.allowed)
}

/// Where a refused text stands.
#[derive(Debug, Clone)]
struct Place {
    /// Index of the parameter.
    pair: usize,
    /// The text, or the refused value of a list.
    text: String,
}

/// Why a parameter is refused.
#[derive(Debug)]
struct Refusal {
    /// None for a missing parameter.
    place: Option<Place>,
    name: String,
    code: &'static str,
    detail: String,
    allowed: Value,
    did_you_mean: Option<String>,
}

impl Refusal {
    fn new(code: &'static str, detail: impl Into<String>, allowed: Value) -> Self {
        Self { place: None, name: String::new(), code, detail: detail.into(), allowed, did_you_mean: None }
    }

    /// Adds the place of the refused text. The innermost place counts.
    fn at(mut self, pair: usize, name: &str, text: &str) -> Self {
        if self.place.is_none() {
            self.place = Some(Place { pair, text: text.to_owned() });
            name.clone_into(&mut self.name);
        }
        self
    }

    fn into_item(self) -> ProblemItem {
        let got = self.place.map_or(Value::Null, |place| json!(place.text));
        ProblemItem {
            pointer: self.name,
            code: self.code.to_owned(),
            detail: self.detail,
            got,
            allowed: self.allowed,
            did_you_mean: self.did_you_mean,
        }
    }
}

impl Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.detail)
    }
}

impl std::error::Error for Refusal {}

impl serde::de::Error for Refusal {
    fn custom<T: Display>(message: T) -> Self {
        Self::new("type", message.to_string(), Value::Null)
    }

    fn invalid_type(_: Unexpected, expected: &dyn Expected) -> Self {
        Self::new("type", "the value cannot be read", json!(expected.to_string()))
    }

    fn invalid_value(_: Unexpected, expected: &dyn Expected) -> Self {
        Self::new("range", "the value is out of range", json!(expected.to_string()))
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        let did_you_mean = suggest(variant, expected);
        Self { did_you_mean, ..Self::new("unknown", "the value is not one of the allowed ones", json!(expected)) }
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        let did_you_mean = suggest(field, expected);
        Self { did_you_mean, ..Self::new("unknown", "there is no such parameter", json!(expected)) }
    }

    fn missing_field(field: &'static str) -> Self {
        Self { name: field.to_owned(), ..Self::new("required", "the parameter is missing", Value::Null) }
    }
}

#[cfg(test)]
mod tests {
    use super::parse;
    use serde::Deserialize;
    use std::collections::BTreeMap;

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Color {
        Red,
        LightBlue,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Sample {
        color: Color,
        #[serde(default)]
        colors: Vec<Color>,
        limit: Option<u64>,
        #[serde(default)]
        dry: bool,
        #[serde(default, rename = "label.KEY")]
        labels: BTreeMap<String, String>,
    }

    fn read(query: &[(&str, &str)]) -> Result<Sample, Vec<(String, String, String)>> {
        let pairs = query.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect();
        parse(pairs).map_err(|errors| {
            errors.into_iter().map(|error| (error.pointer, error.code, error.allowed.to_string())).collect()
        })
    }

    #[test]
    fn values_lists_and_maps_are_read() {
        let sample = read(&[
            ("color", "red"),
            ("color", "light_blue"),
            ("colors", "red,light_blue"),
            ("colors", "red"),
            ("limit", " 7 "),
            ("dry", "true"),
            ("label.a", "1"),
            ("label.b.c", "2,3"),
        ])
        .unwrap();
        assert!(matches!(sample.color, Color::LightBlue) && sample.colors.len() == 3);
        assert!(sample.dry && sample.limit == Some(7));
        assert_eq!(sample.labels, BTreeMap::from([("a".into(), "1".into()), ("b.c".into(), "2,3".into())]));
    }

    #[test]
    fn all_errors_come_at_once_with_place_allowed_values_and_suggestion() {
        let query = [("colr", "red"), ("colors", "red,blue,lightblue"), ("limit", "-1"), ("dry", "yes"), ("x.y", "1")];
        let found = read(&query).unwrap_err();
        let places: Vec<(&str, &str)> = found.iter().map(|(place, code, _)| (place.as_str(), code.as_str())).collect();
        let expected = [
            ("colr", "unknown"),
            ("colors", "unknown"),
            ("colors", "unknown"),
            ("limit", "type"),
            ("dry", "type"),
            ("x.y", "unknown"),
            ("color", "required"),
        ];
        assert_eq!(places, expected);
        assert_eq!(found[6].2, "[\"red\",\"light_blue\"]");
        let pairs = vec![("color".to_owned(), "lightblue".to_owned()), ("colr".to_owned(), String::new())];
        let errors = parse::<Sample>(pairs).unwrap_err();
        assert_eq!(errors.len(), 2);
        assert_eq!(errors[0].did_you_mean.as_deref(), Some("light_blue"));
        assert_eq!(errors[1].did_you_mean.as_deref(), Some("color"));
        assert_eq!(errors[0].got, "lightblue");
    }
}
