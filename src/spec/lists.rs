//! Lists as declared parameters.

use super::parameter::{Parameter, keyword};
use super::violation::Violation;
use serde_json::{Map, Value, json};

/// What restricts a list: its least and its largest length, and the domain of each item.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Items<E>(pub usize, pub usize, pub E);

/// A list of parameters of one type.
#[derive(Debug, Clone, PartialEq)]
pub struct Listed<T>(pub Vec<T>);

impl<T> Default for Listed<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Parameter> Parameter for Listed<T> {
    type Domain = Items<T::Domain>;

    fn any() -> Self::Domain {
        Items(0, usize::MAX, T::any())
    }

    fn parse(given: &Value, domain: Self::Domain, place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let Items(least, most, each) = domain;
        let Some(list) = given.as_array().filter(|list| (least..=most).contains(&list.len())) else {
            let detail = match (least, most) {
                (0, usize::MAX) => "a list is needed".to_owned(),
                (_, usize::MAX) => format!("a list of at least {least} is needed"),
                _ if least == most => format!("a list of {least} is needed"),
                _ => format!("a list of {least} to {most} is needed"),
            };
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(domain)));
            return None;
        };
        let items: Vec<Option<T>> =
            list.iter().enumerate().map(|(k, item)| T::parse(item, each, &format!("{place}/{k}"), errors)).collect();
        items.into_iter().collect::<Option<_>>().map(Self)
    }

    fn allowed(Items(least, most, each): Self::Domain) -> Value {
        let mut allowed = json!({"at_least": least, "each": T::allowed(each)});
        if most != usize::MAX {
            allowed["at_most"] = json!(most);
        }
        allowed
    }

    fn schema(Items(least, most, each): Self::Domain) -> Map<String, Value> {
        let mut schema = keyword("type", "array");
        schema.insert("items".into(), Value::Object(T::schema(each)));
        schema.insert("minItems".into(), json!(least));
        if most != usize::MAX {
            schema.insert("maxItems".into(), json!(most));
        }
        schema
    }

    fn to_json(&self) -> Value {
        self.0.iter().map(Parameter::to_json).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::parameter::NOT_NEGATIVE;
    use super::{Items, Listed, Parameter};
    use serde_json::json;

    #[test]
    fn lists_tell_all_that_is_wrong_at_its_place() {
        let parse = |given| {
            let mut errors = Vec::new();
            let found = Listed::<f64>::parse(&given, Items(1, 3, NOT_NEGATIVE), "/x", &mut errors);
            (found, errors.into_iter().map(|error| error.pointer).collect::<Vec<_>>())
        };
        assert_eq!(parse(json!([1, 0.5])), (Some(Listed(vec![1.0, 0.5])), Vec::new()));
        assert_eq!(parse(json!([-1, 2, "a"])), (None, vec!["/x/0".to_owned(), "/x/2".to_owned()]));
        for wrong in [json!([]), json!([1, 2, 3, 4]), json!(2)] {
            assert_eq!(parse(wrong), (None, vec!["/x".to_owned()]));
        }
        assert_eq!(Listed::<f64>::allowed(Items(2, usize::MAX, NOT_NEGATIVE)).get("at_most"), None);
    }
}
