//! Formulas and their named numbers as declared parameters.

use super::grammar::{MOST_BYTES, check_syntax, why_not_a_parameter};
use crate::spec::{Listed, Object, Parameter, Violation};
use serde_json::{Value, json};

/// The text of a formula; a number stands for itself.
#[derive(Debug, Clone, PartialEq)]
pub struct FormulaText(pub String);

impl From<&str> for FormulaText {
    fn from(text: &str) -> Self {
        Self(text.to_owned())
    }
}

const SHORT: &str = "a formula, such as \"sin(pi*x)*y^2\", or a number";

impl Parameter for FormulaText {
    type Domain = ();

    fn any() {}

    fn parse(given: &Value, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let text = match given {
            Value::String(text) => text.clone(),
            Value::Number(number) => number.to_string(),
            _ => {
                errors.push(Violation::new(
                    place,
                    "type",
                    "a formula is a text or a number",
                    given.clone(),
                    json!(SHORT),
                ));
                return None;
            }
        };
        match check_syntax(&text) {
            Ok(()) => Some(Self(text)),
            Err(error) => {
                let allowed = if error.allowed.is_empty() { json!(SHORT) } else { json!(error.allowed) };
                errors.push(Violation::new(place, "formula", error.to_string(), shortened(&text), allowed));
                None
            }
        }
    }

    fn allowed((): ()) -> Value {
        json!(SHORT)
    }

    fn schema((): ()) -> Object {
        let text = json!({"type": "string", "minLength": 1, "maxLength": MOST_BYTES});
        Object::from_iter([("anyOf".to_owned(), json!([text, {"type": "number"}]))])
    }

    fn to_json(&self) -> Value {
        json!(self.0)
    }
}

/// A formula as an error repeats it.
pub(super) fn shortened(text: &str) -> Value {
    const MOST: usize = 200;
    if text.chars().count() <= MOST {
        json!(text)
    } else {
        json!(format!("{}…", text.chars().take(MOST).collect::<String>()))
    }
}

/// Numbers that formulas call by name.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NamedNumbers(pub Vec<(String, f64)>);

/// No named numbers.
#[must_use]
pub fn constants() -> NamedNumbers {
    NamedNumbers::default()
}

impl Parameter for NamedNumbers {
    type Domain = ();

    fn any() {}

    fn parse(given: &Value, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        const MOST: usize = 64;
        let allowed = || Self::allowed(());
        let Value::Object(members) = given else {
            errors.push(Violation::new(place, "type", "an object of numbers is needed", given.clone(), allowed()));
            return None;
        };
        if members.len() > MOST {
            let detail = format!("there are {} named numbers", members.len());
            errors.push(Violation::new(place, "range", detail, members.len(), json!(format!("at most {MOST}"))));
            return None;
        }
        let before = errors.len();
        let mut numbers = Vec::new();
        for (name, value) in members {
            let at = format!("{place}/{}", crate::spec::escape(name));
            if let Some(reason) = why_not_a_parameter(name) {
                errors.push(Violation::new(&at, "name", reason, json!(name), json!("another name")));
            }
            match value.as_f64() {
                Some(number) => numbers.push((name.clone(), number)),
                None => {
                    errors.push(Violation::new(&at, "type", "a number is needed", value.clone(), json!("a number")));
                }
            }
        }
        (errors.len() == before).then_some(Self(numbers))
    }

    fn allowed((): ()) -> Value {
        json!("an object of numbers by name, such as {\"a\": 1.5}")
    }

    fn schema((): ()) -> Object {
        let mut schema = Object::from_iter([("type".to_owned(), json!("object"))]);
        schema.insert("additionalProperties".into(), json!({"type": "number"}));
        schema.insert("propertyNames".into(), json!({"pattern": "^[A-Za-z_][A-Za-z0-9_]*$"}));
        schema
    }

    fn to_json(&self) -> Value {
        Value::Object(self.0.iter().map(|(name, value)| (name.clone(), json!(value))).collect())
    }
}

/// A list of formulas: the components of a vector, or one for each of several quantities.
pub type FormulaList = Listed<FormulaText>;

/// Lists of formulas: a vector for each of several things.
pub type FormulaLists = Listed<FormulaList>;

impl<const N: usize> From<[&str; N]> for FormulaList {
    fn from(texts: [&str; N]) -> Self {
        Self(texts.into_iter().map(FormulaText::from).collect())
    }
}

impl FormulaList {
    /// The formulas with their places below a member of this name.
    #[must_use]
    pub fn at<'a>(&'a self, name: &str) -> Vec<(String, &'a FormulaText)> {
        self.0.iter().enumerate().map(|(k, text)| (format!("{name}/{k}"), text)).collect()
    }

    /// The components of a vector in `D` dimensions, or what is wrong with their number.
    ///
    /// # Errors
    /// Another number of formulas than dimensions.
    pub fn components<const D: usize>(
        &self,
        pointer: &str,
        name: &str,
    ) -> Result<Vec<(String, &FormulaText)>, Violation> {
        let found = self.0.len();
        if found == D {
            return Ok(self.at(name));
        }
        let detail = format!("a vector has {D} components in a scene of {D} dimensions, here are {found}");
        Err(Violation::new(format!("{pointer}/{name}"), "conflict", detail, found, json!(format!("{D} formulas"))))
    }
}
