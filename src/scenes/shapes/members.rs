//! Shapes within a shape, as parameters.

use crate::spec::{Choice, Parameter, Violation, choice};
use serde_json::{Map, Value, json};

/// Depth of nested shapes at most.
const MOST_DEPTH: usize = 12;
/// Members of one shape at most.
const MOST_MEMBERS: usize = 32;

/// A shape within another one.
#[derive(Debug, Clone, PartialEq)]
pub struct Member<T>(pub Box<T>);

/// One or several shapes within another one.
#[derive(Debug, Clone, PartialEq)]
pub struct Members<T>(pub Vec<T>);

/// A member at a place of the body, unless it is nested too deeply there.
fn parse<T: Choice>(given: &Value, place: &str, errors: &mut Vec<Violation>) -> Option<T> {
    let depth = place.split('/').filter(|part| ["of", "from", "minus"].contains(part)).count();
    if depth > MOST_DEPTH {
        let detail = "shapes are nested too deeply";
        errors.push(Violation::new(place, "range", detail, Value::Null, json!(format!("{MOST_DEPTH} levels at most"))));
        return None;
    }
    choice::parse(given, place, errors)
}

/// The schema of a member. Shapes may contain shapes, so that it does not repeat the fields of all.
fn member_schema<T: Choice>() -> Map<String, Value> {
    let schema = json!({
        "type": "object",
        "properties": {"type": {"enum": T::names()}},
        "required": ["type"],
        "description": "a shape that is known exactly, with the fields that it has by itself",
    });
    schema.as_object().cloned().unwrap_or_default()
}

impl<T: Choice> Parameter for Member<T> {
    type Domain = ();

    fn any() {}

    fn parse(given: &Value, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        parse(given, place, errors).map(|shape| Self(Box::new(shape)))
    }

    fn allowed((): ()) -> Value {
        T::names().into()
    }

    fn schema((): ()) -> Map<String, Value> {
        member_schema::<T>()
    }

    fn to_json(&self) -> Value {
        choice::to_json(self.0.as_ref())
    }
}

impl<T: Choice> Parameter for Members<T> {
    type Domain = ();

    fn any() {}

    fn parse(given: &Value, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let Some(list) = given.as_array().filter(|list| (1..=MOST_MEMBERS).contains(&list.len())) else {
            let detail = format!("a list of 1 to {MOST_MEMBERS} shapes is needed");
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(())));
            return None;
        };
        let members: Vec<Option<T>> =
            list.iter().enumerate().map(|(k, item)| parse(item, &format!("{place}/{k}"), errors)).collect();
        members.into_iter().collect::<Option<Vec<_>>>().map(Self)
    }

    fn allowed((): ()) -> Value {
        json!({"at_least": 1, "at_most": MOST_MEMBERS, "each": T::names()})
    }

    fn schema((): ()) -> Map<String, Value> {
        let schema = json!({"type": "array", "items": member_schema::<T>(), "minItems": 1, "maxItems": MOST_MEMBERS});
        schema.as_object().cloned().unwrap_or_default()
    }

    fn to_json(&self) -> Value {
        self.0.iter().map(choice::to_json).collect()
    }
}
