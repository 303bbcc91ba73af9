//! A list of places, at least one.

use super::parameter::{Coordinates, Parameter, Sign};
use super::violation::Violation;
use serde_json::{Map, Value, json};

/// Places in the plane or in space, at least one and at most [`MOST`].
#[derive(Debug, Clone, PartialEq)]
pub struct Places(pub Vec<Coordinates>);

/// Number of places at most.
const MOST: usize = 1000;

impl Parameter for Places {
    type Domain = ();

    fn any() {}

    fn parse(given: &Value, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let list = given.as_array().filter(|list| (1..=MOST).contains(&list.len()));
        let Some(list) = list else {
            let detail = format!("a list of 1 to {MOST} places is needed");
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(())));
            return None;
        };
        let parsed: Vec<Option<Coordinates>> = list
            .iter()
            .enumerate()
            .map(|(k, item)| Coordinates::parse(item, Sign::Any, &format!("{place}/{k}"), errors))
            .collect();
        parsed.into_iter().collect::<Option<Vec<_>>>().map(Self)
    }

    fn allowed((): ()) -> Value {
        json!("a list of places, each of two or three numbers")
    }

    fn schema((): ()) -> Map<String, Value> {
        let item = Coordinates::schema(Sign::Any);
        let schema = json!({"type": "array", "items": item, "minItems": 1, "maxItems": MOST});
        schema.as_object().cloned().unwrap_or_default()
    }

    fn to_json(&self) -> Value {
        Value::Array(self.0.iter().map(Coordinates::to_json).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::{Parameter, Places};
    use serde_json::json;

    #[test]
    fn every_wrong_place_is_named() {
        let mut errors = Vec::new();
        assert_eq!(Places::parse(&json!([[1, 2], [1], "x"]), (), "/from", &mut errors), None);
        let at: Vec<&str> = errors.iter().map(|error| error.pointer.as_str()).collect();
        assert_eq!(at, ["/from/1", "/from/2"]);
        errors.clear();
        assert!(Places::parse(&json!([]), (), "/from", &mut errors).is_none() && errors.len() == 1);
        let good = json!([[1.0, 2.0, 3.0]]);
        assert_eq!(Places::parse(&good, (), "/from", &mut errors).unwrap().to_json(), good);
    }
}
