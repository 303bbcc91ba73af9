//! Checking JSON against declared parameters: every violation is found, every default filled in.

use super::schema::{Default, Kind, Parameter, Variant};
use serde_json::{Map, Value, json};

/// One thing wrong with a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Violation {
    /// JSON pointer to the place.
    pub pointer: String,
    /// A short word: `required`, `type`, `range`, `unknown`, `unknown_field`, `conflict`, …
    pub code: &'static str,
    /// A sentence fragment.
    pub detail: String,
    /// What stands there.
    pub got: Value,
    /// What would be accepted.
    pub allowed: Value,
    /// A known name that is spelled alike.
    pub did_you_mean: Option<String>,
}

impl Violation {
    /// A violation without a suggestion.
    #[must_use]
    pub fn new(
        pointer: impl Into<String>,
        code: &'static str,
        detail: impl Into<String>,
        got: &Value,
        allowed: Value,
    ) -> Self {
        Self { pointer: pointer.into(), code, detail: detail.into(), got: got.clone(), allowed, did_you_mean: None }
    }

    /// The same with a prefix before the pointer.
    #[must_use]
    pub fn under(mut self, prefix: &str) -> Self {
        self.pointer.insert_str(0, prefix);
        self
    }
}

/// The known name nearest in spelling, if one is near.
#[must_use]
pub fn closest(name: &str, known: &[&str]) -> Option<String> {
    known
        .iter()
        .map(|candidate| (strsim::damerau_levenshtein(name, candidate), *candidate))
        .filter(|(distance, candidate)| *distance <= 1 + candidate.len().min(name.len()) / 4)
        .min()
        .map(|(_, candidate)| candidate.to_owned())
}

/// Escapes a name for use in a JSON pointer.
#[must_use]
pub fn escaped(name: &str) -> String {
    name.replace('~', "~0").replace('/', "~1")
}

/// `given` over `preset`: what is given wins, objects of the same `type` (or without one) are merged.
#[must_use]
pub fn laid_under(preset: Map<String, Value>, given: Map<String, Value>) -> Map<String, Value> {
    let mut merged = preset;
    for (name, value) in given {
        let value = match (merged.get(&name), value) {
            // A bare name is the object of that type.
            (Some(Value::Object(below)), Value::String(bare)) if below.get("type").is_some_and(|t| *t == bare) => {
                Value::Object(below.clone())
            }
            (Some(Value::Object(below)), Value::Object(above))
                if !above.contains_key("type") || above.get("type") == below.get("type") =>
            {
                Value::Object(laid_under(below.clone(), above))
            }
            (_, value) => value,
        };
        merged.insert(name, value);
    }
    merged
}

/// Checks an object against its parameters and returns it with every default, in the order of declaration.
///
/// Values in violation are left out of the result; unknown fields are violations.
pub fn check(
    parameters: &[Parameter],
    given: &Map<String, Value>,
    pointer: &str,
    violations: &mut Vec<Violation>,
) -> Map<String, Value> {
    let names: Vec<&str> = parameters.iter().map(|p| p.name).collect();
    for (name, value) in given {
        if !names.contains(&name.as_str()) {
            let place = format!("{pointer}/{}", escaped(name));
            let mut violation = Violation::new(place, "unknown_field", "there is no such field", value, json!(names));
            violation.did_you_mean = closest(name, &names);
            violations.push(violation);
        }
    }
    let mut resolved = Map::new();
    for parameter in parameters {
        let place = format!("{pointer}/{}", parameter.name);
        let value = match (given.get(parameter.name), parameter.default) {
            (None | Some(Value::Null), Default::Absent) | (Some(Value::Null), Default::JsonOrNull(_)) => {
                Some(Value::Null)
            }
            (None, Default::Required) => {
                violations.push(Violation::new(
                    place,
                    "required",
                    parameter.doc,
                    &Value::Null,
                    describe(&parameter.kind),
                ));
                None
            }
            (None, Default::Json(text) | Default::JsonOrNull(text)) => {
                // Defaults are part of the program; a test parses every one.
                let default = serde_json::from_str(text).unwrap_or(Value::Null);
                check_value(&parameter.kind, &default, &place, violations)
            }
            (Some(value), _) => check_value(&parameter.kind, value, &place, violations),
        };
        if let Some(value) = value {
            resolved.insert(parameter.name.to_owned(), value);
        }
    }
    resolved
}

fn check_value(kind: &Kind, value: &Value, pointer: &str, violations: &mut Vec<Violation>) -> Option<Value> {
    match kind {
        Kind::Number { .. } => check_number(kind, value, pointer, violations),
        Kind::Integer { least, most } => {
            // 240.0 is a whole number too.
            let whole = value
                .as_u64()
                .or_else(|| value.as_f64().filter(|x| x.fract() == 0.0 && *x >= 0.0 && *x < 9e15).map(|x| x as u64));
            match whole {
                Some(number) if (*least..=*most).contains(&number) => Some(json!(number)),
                Some(_) => refuse(violations, pointer, "range", "the number is out of range", value, kind),
                None => refuse(violations, pointer, "type", "a whole number is needed", value, kind),
            }
        }
        Kind::Vector { positive } => {
            let numbers: Option<Vec<f64>> = value.as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
            match numbers {
                Some(numbers) if numbers.len() == 2 || numbers.len() == 3 => {
                    if *positive && numbers.iter().any(|x| *x <= 0.0) {
                        return refuse(violations, pointer, "range", "every number must be positive", value, kind);
                    }
                    Some(json!(numbers))
                }
                _ => refuse(violations, pointer, "type", "a list of two or three numbers is needed", value, kind),
            }
        }
        Kind::Text if value.as_str().is_some_and(|text| !text.is_empty()) => Some(value.clone()),
        Kind::Text => refuse(violations, pointer, "type", "a text is needed", value, kind),
        Kind::Flag if value.is_boolean() => Some(value.clone()),
        Kind::Flag => refuse(violations, pointer, "type", "true or false is needed", value, kind),
        Kind::Word(words) => match value.as_str() {
            Some(word) if words.contains(&word) => Some(value.clone()),
            word => {
                refuse(violations, pointer, "unknown", "one of the known words is needed", value, kind);
                suggest(violations, word, words);
                None
            }
        },
        Kind::Choice(variants) => check_choice(variants(), value, pointer, violations),
        Kind::Group(parameters) => {
            let Some(given) = value.as_object() else {
                return refuse(violations, pointer, "type", "an object is needed", value, kind);
            };
            let before = violations.len();
            let checked = check(parameters, given, pointer, violations);
            (violations.len() == before).then_some(Value::Object(checked))
        }
        Kind::Choices { variants, least } => {
            let Some(list) = value.as_array().filter(|list| list.len() >= *least) else {
                return refuse(violations, pointer, "type", "a list of choices is needed", value, kind);
            };
            let checked: Vec<Option<Value>> = list
                .iter()
                .enumerate()
                .map(|(k, item)| check_choice(variants(), item, &format!("{pointer}/{k}"), violations))
                .collect();
            checked.into_iter().collect::<Option<Vec<Value>>>().map(Value::Array)
        }
    }
}

fn check_number(kind: &Kind, value: &Value, pointer: &str, violations: &mut Vec<Violation>) -> Option<Value> {
    let Kind::Number { above, least, below, most } = kind else {
        return None;
    };
    let Some(number) = value.as_f64() else {
        return refuse(violations, pointer, "type", "a number is needed", value, kind);
    };
    let fits = above.is_none_or(|bound| number > bound)
        && least.is_none_or(|bound| number >= bound)
        && below.is_none_or(|bound| number < bound)
        && most.is_none_or(|bound| number <= bound);
    if fits {
        Some(json!(number))
    } else {
        refuse(violations, pointer, "range", "the number is out of range", value, kind)
    }
}

fn check_choice(variants: &[Variant], value: &Value, pointer: &str, violations: &mut Vec<Violation>) -> Option<Value> {
    let names: Vec<&str> = variants.iter().map(|v| v.name).collect();
    let empty = Map::new();
    let (name, given, at) = match value {
        Value::String(name) => (Some(name.as_str()), &empty, pointer.to_owned()),
        Value::Object(given) => (given.get("type").and_then(Value::as_str), given, format!("{pointer}/type")),
        _ => {
            let detail = "a choice is a name or an object with a type";
            violations.push(Violation::new(pointer, "type", detail, value, json!(names)));
            return None;
        }
    };
    let Some(variant) = name.and_then(|name| variants.iter().find(|v| v.name == name)) else {
        let code = if name.is_some() { "unknown" } else { "required" };
        let got = if name.is_some() { json!(name) } else { Value::Null };
        violations.push(Violation::new(at, code, "the choice is not known", &got, json!(names)));
        suggest(violations, name, &names);
        return None;
    };
    let before = violations.len();
    let mut fields = given.clone();
    fields.shift_remove("type");
    let mut checked = check(variant.parameters, &fields, pointer, violations);
    if violations.len() > before {
        return None;
    }
    let mut whole = Map::new();
    whole.insert("type".into(), variant.name.into());
    whole.append(&mut checked);
    Some(Value::Object(whole))
}

fn refuse(
    violations: &mut Vec<Violation>,
    pointer: &str,
    code: &'static str,
    detail: &str,
    value: &Value,
    kind: &Kind,
) -> Option<Value> {
    violations.push(Violation::new(pointer, code, detail, value, describe(kind)));
    None
}

fn suggest(violations: &mut [Violation], name: Option<&str>, known: &[&str]) {
    if let (Some(violation), Some(name)) = (violations.last_mut(), name) {
        violation.did_you_mean = closest(name, known);
    }
}

/// The accepted values of a kind, for people.
#[must_use]
pub fn describe(kind: &Kind) -> Value {
    match kind {
        Kind::Number { above, least, below, most } => {
            let mut parts = Vec::new();
            parts.extend(above.map(|bound| format!("> {bound}")));
            parts.extend(least.map(|bound| format!("≥ {bound}")));
            parts.extend(below.map(|bound| format!("< {bound}")));
            parts.extend(most.map(|bound| format!("≤ {bound}")));
            if parts.is_empty() { json!("a number") } else { json!(format!("a number {}", parts.join(" and "))) }
        }
        Kind::Integer { least, most } if *most == u64::MAX => {
            json!(format!("a whole number ≥ {least}"))
        }
        Kind::Integer { least, most } => json!(format!("a whole number from {least} to {most}")),
        Kind::Vector { positive: true } => json!("two or three positive numbers"),
        Kind::Vector { positive: false } => json!("two or three numbers"),
        Kind::Choice(variants) => json!(variants().iter().map(|v| v.name).collect::<Vec<_>>()),
        Kind::Choices { variants, least } => {
            json!({"at_least": least, "each": variants().iter().map(|v| v.name).collect::<Vec<_>>()})
        }
        Kind::Group(parameters) => json!({"fields": parameters.iter().map(|p| p.name).collect::<Vec<_>>()}),
        Kind::Text => json!("a text"),
        Kind::Flag => json!([true, false]),
        Kind::Word(words) => json!(words),
    }
}
