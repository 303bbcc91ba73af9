//! Lists as declared parameters.

use super::parameter::{NOT_NEGATIVE, Parameter, keyword};
use super::violation::Violation;
use serde_json::{Map, Value, json};

/// The least and the largest length of a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Items(pub usize, pub usize);

/// A list of parameters of one type.
#[derive(Debug, Clone, PartialEq)]
pub struct Listed<T>(pub Vec<T>);

impl<T> Default for Listed<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Parameter> Parameter for Listed<T> {
    type Domain = Items;

    fn any() -> Items {
        Items(0, usize::MAX)
    }

    fn parse(given: &Value, Items(least, most): Items, place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let Some(list) = given.as_array().filter(|list| (least..=most).contains(&list.len())) else {
            let detail = "a list is needed";
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(Items(least, most))));
            return None;
        };
        let items: Vec<Option<T>> = list
            .iter()
            .enumerate()
            .map(|(k, item)| T::parse(item, T::any(), &format!("{place}/{k}"), errors))
            .collect();
        items.into_iter().collect::<Option<_>>().map(Self)
    }

    fn allowed(Items(least, most): Items) -> Value {
        json!({"from": least, "to": most, "each": T::allowed(T::any())})
    }

    fn schema(Items(least, most): Items) -> Map<String, Value> {
        let mut schema = keyword("type", "array");
        schema.insert("items".into(), Value::Object(T::schema(T::any())));
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

/// Lists of texts, and of numbers that are not negative.
macro_rules! lists {
    ($($type:ty, $domain:expr, $each:literal;)*) => {$(
        impl Parameter for Vec<$type> {
            type Domain = Items;

            fn any() -> Items {
                Items(0, usize::MAX)
            }

            fn parse(given: &Value, Items(least, most): Items, place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
                let Some(list) = given.as_array().filter(|list| (least..=most).contains(&list.len())) else {
                    let detail = concat!("a list of ", $each, " is needed");
                    errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(Items(least, most))));
                    return None;
                };
                let items: Vec<Option<$type>> = list
                    .iter()
                    .enumerate()
                    .map(|(k, item)| <$type>::parse(item, $domain, &format!("{place}/{k}"), errors))
                    .collect();
                items.into_iter().collect()
            }

            fn allowed(Items(least, most): Items) -> Value {
                json!(format!(concat!("a list of {} to {} ", $each), least, most))
            }

            fn schema(Items(least, most): Items) -> Map<String, Value> {
                let mut schema = keyword("type", "array");
                schema.insert("items".into(), Value::Object(<$type>::schema($domain)));
                schema.insert("minItems".into(), json!(least));
                if most != usize::MAX {
                    schema.insert("maxItems".into(), json!(most));
                }
                schema
            }

            fn to_json(&self) -> Value {
                json!(self)
            }
        }
    )*};
}

lists! {
    String, (), "names";
    f64, NOT_NEGATIVE, "numbers ≥ 0";
}
