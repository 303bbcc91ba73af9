//! Small fields of a body: name, labels, priority.

use meniscus::spec::{Json, Object, Parameter, Violation, escape};
use serde_json::json;
use std::collections::BTreeMap;

/// Bytes of a name, and of the value of a label, at most.
const LONGEST_TEXT: usize = 200;
/// Bytes of the key of a label at most.
const LONGEST_KEY: usize = 100;
/// Number of labels at most.
const MOST_LABELS: usize = 64;
/// Priorities.
const PRIORITIES: std::ops::RangeInclusive<i64> = -100..=100;

/// A name, for people.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Name(pub String);

impl Parameter for Name {
    type Domain = ();

    fn any() {}

    fn parse(given: &Json, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let text = given.as_str().filter(|text| text.len() <= LONGEST_TEXT);
        if text.is_none() {
            errors.push(Violation::new(place, "type", "a text is needed", given.clone(), Self::allowed(())));
        }
        text.map(|text| Self(text.to_owned()))
    }

    fn allowed((): ()) -> Json {
        json!(format!("a text of at most {LONGEST_TEXT} bytes"))
    }

    fn schema((): ()) -> Object {
        Object::from_iter([("type".to_owned(), json!("string")), ("maxLength".to_owned(), json!(LONGEST_TEXT))])
    }

    fn to_json(&self) -> Json {
        json!(self.0)
    }
}

/// Labels, for filters: texts by key.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Labels(pub BTreeMap<String, String>);

impl Parameter for Labels {
    type Domain = ();

    fn any() {}

    fn parse(given: &Json, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let Some(map) = given.as_object().filter(|map| map.len() <= MOST_LABELS) else {
            let detail = "labels are an object of texts";
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(())));
            return None;
        };
        let before = errors.len();
        let mut labels = BTreeMap::new();
        for (key, value) in map {
            match value.as_str().filter(|text| text.len() <= LONGEST_TEXT && key.len() <= LONGEST_KEY) {
                Some(text) => drop(labels.insert(key.clone(), text.to_owned())),
                None => {
                    let at = format!("{place}/{}", escape(key));
                    let allowed = format!("a text of at most {LONGEST_TEXT} bytes");
                    errors.push(Violation::new(at, "type", "a label is a text", value.clone(), allowed));
                }
            }
        }
        (errors.len() == before).then_some(Self(labels))
    }

    fn allowed((): ()) -> Json {
        json!(format!("at most {MOST_LABELS} texts by key"))
    }

    fn schema((): ()) -> Object {
        let text = json!({"type": "string", "maxLength": LONGEST_TEXT});
        Object::from_iter([
            ("type".to_owned(), json!("object")),
            ("additionalProperties".to_owned(), text),
            ("maxProperties".to_owned(), json!(MOST_LABELS)),
        ])
    }

    fn to_json(&self) -> Json {
        json!(self.0)
    }
}

/// Rank in the queue: higher goes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Priority(pub i64);

impl Parameter for Priority {
    type Domain = ();

    fn any() {}

    fn parse(given: &Json, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        // A whole number may be written 1.0.
        let whole = |number: f64| (number.fract() == 0.0 && number.abs() < 1e9).then_some(number as i64);
        let number = given.as_i64().or_else(|| whole(given.as_f64()?)).filter(|number| PRIORITIES.contains(number));
        if number.is_none() {
            let detail = "a priority is a whole number";
            errors.push(Violation::new(place, "range", detail, given.clone(), Self::allowed(())));
        }
        number.map(Self)
    }

    fn allowed((): ()) -> Json {
        json!("−100 to 100")
    }

    fn schema((): ()) -> Object {
        Object::from_iter([
            ("type".to_owned(), json!("integer")),
            ("minimum".to_owned(), json!(PRIORITIES.start())),
            ("maximum".to_owned(), json!(PRIORITIES.end())),
        ])
    }

    fn to_json(&self) -> Json {
        json!(self.0)
    }
}
