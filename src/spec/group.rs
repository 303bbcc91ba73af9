//! Objects with declared fields.

use super::parameter::Parameter;
use super::violation::{Violation, escape};
use serde_json::{Map, Value, json};

/// An object with declared fields. [`crate::group!`] writes the implementation.
pub trait Group: Sized + Clone {
    /// Names of the fields in JSON, in the order of declaration.
    fn names() -> Vec<&'static str>;

    /// What each field is, in the order of declaration.
    fn declarations() -> Vec<Declaration>;

    /// Reads the fields. Names that are not declared are not looked at.
    fn parse_fields(given: &Map<String, Value>, place: &str, errors: &mut Vec<Violation>) -> Option<Self>;

    /// Adds the fields to an object, each with its value.
    fn write_fields(&self, object: &mut Map<String, Value>);
}

/// One declared field, as people and programs see it.
#[derive(Debug, Clone, PartialEq)]
pub struct Declaration {
    /// Name in JSON.
    pub name: &'static str,
    /// What it means.
    pub doc: String,
    /// Accepted values as JSON Schema.
    pub schema: Map<String, Value>,
    /// The default, if there is one.
    pub default: Option<Value>,
    /// Whether the field must be given.
    pub is_required: bool,
    /// Whether a restart from a checkpoint may change it.
    pub is_restart_safe: bool,
}

impl Declaration {
    /// The declaration of a field of type `T`.
    #[must_use]
    pub fn new<T: Parameter>(name: &'static str, doc: &str, domain: T::Domain, default: Option<fn() -> T>) -> Self {
        Self {
            name,
            doc: doc.trim().to_owned(),
            schema: T::schema(domain),
            default: default.map(|value| value().to_json()),
            is_required: default.is_none() && !T::IS_OPTIONAL,
            is_restart_safe: false,
        }
    }

    /// The same, marked as a field that a restart may change.
    #[must_use]
    pub fn restart_safe(self) -> Self {
        Self { is_restart_safe: true, ..self }
    }

    /// The unit that the name carries: `_h` in particle spacings, `_dn` in point spacings, `_s`, `_bytes`.
    #[must_use]
    pub fn unit(&self) -> Option<&'static str> {
        let units = [("_h", "h"), ("_dn", "δn"), ("_s", "s"), ("_bytes", "bytes")];
        // A ratio to the spacing has no unit.
        if self.name.ends_with("_over_h") {
            return None;
        }
        units.into_iter().find(|(ending, _)| self.name.ends_with(ending)).map(|(_, unit)| unit)
    }

    /// The schema of the field, with its meaning, default and unit.
    #[must_use]
    pub fn property(&self) -> Value {
        let mut schema = self.schema.clone();
        schema.insert("description".into(), json!(self.doc));
        if let Some(default) = &self.default {
            schema.insert("default".into(), default.clone());
        }
        if let Some(unit) = self.unit() {
            schema.insert("x-unit".into(), json!(unit));
        }
        if self.is_restart_safe {
            schema.insert("x-restart-safe".into(), json!(true));
        }
        Value::Object(schema)
    }
}

/// Adds an error for each name that is not declared.
pub fn check_names(given: &Map<String, Value>, known: &[&str], place: &str, errors: &mut Vec<Violation>) {
    for (name, value) in given.iter().filter(|(name, _)| !known.contains(&name.as_str())) {
        let at = format!("{place}/{}", escape(name));
        let detail = "there is no such field";
        errors.push(Violation::unknown(at, "unknown_field", detail, value.clone(), Some(name), known));
    }
}

/// Where a field is declared.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// Name in JSON.
    pub name: &'a str,
    /// What it means: the detail of the error where a required field is missing.
    pub doc: &'a str,
    /// JSON pointer to the object.
    pub place: &'a str,
}

impl Field<'_> {
    /// Reads the field from its object, or takes its default.
    pub fn parse<T: Parameter>(
        self,
        given: &Map<String, Value>,
        domain: T::Domain,
        default: Option<fn() -> T>,
        errors: &mut Vec<Violation>,
    ) -> Option<T> {
        let place = format!("{}/{}", self.place, self.name);
        match (given.get(self.name), default) {
            (Some(value), _) => T::parse(value, domain, &place, errors),
            (None, Some(default)) => Some(default()),
            (None, None) if T::IS_OPTIONAL => T::parse(&Value::Null, domain, &place, errors),
            (None, None) => {
                errors.push(Violation::new(place, "required", self.doc.trim(), Value::Null, T::allowed(domain)));
                None
            }
        }
    }
}

/// Reads an object that is a group and nothing else.
pub fn parse<T: Group>(given: &Value, place: &str, errors: &mut Vec<Violation>) -> Option<T> {
    let Some(object) = given.as_object() else {
        errors.push(Violation::new(place, "type", "an object is needed", given.clone(), allowed::<T>()));
        return None;
    };
    let before = errors.len();
    check_names(object, &T::names(), place, errors);
    let found = T::parse_fields(object, place, errors);
    found.filter(|_| errors.len() == before)
}

/// The fields of a group, for people.
#[must_use]
pub fn allowed<T: Group>() -> Value {
    json!({"fields": T::names()})
}

/// The schema of an object with these fields alone.
#[must_use]
pub fn schema(declarations: &[Declaration]) -> Map<String, Value> {
    let required: Vec<&str> = declarations.iter().filter(|d| d.is_required).map(|d| d.name).collect();
    let properties: Map<String, Value> = declarations.iter().map(|d| (d.name.to_owned(), d.property())).collect();
    let mut schema = Map::new();
    schema.insert("type".into(), json!("object"));
    schema.insert("properties".into(), Value::Object(properties));
    schema.insert("required".into(), json!(required));
    schema.insert("additionalProperties".into(), json!(false));
    schema
}

/// A group as JSON, every field written out.
#[must_use]
pub fn to_json<T: Group>(group: &T) -> Value {
    let mut object = Map::new();
    group.write_fields(&mut object);
    Value::Object(object)
}
