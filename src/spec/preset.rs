//! Presets: values that a name stands for, laid under what a person gives.

use super::choice::Choice;
use super::group::Group;
use super::parameter::Parameter;
use serde_json::{Map, Value};

/// The name of a declared field in JSON, with the type and the domain of its values.
#[derive(Debug)]
pub struct Key<T: Parameter> {
    name: &'static str,
    domain: T::Domain,
}

impl<T: Parameter> Clone for Key<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T: Parameter> Copy for Key<T> {}

impl<T: Parameter> Key<T> {
    /// The key of a field whose values lie in a domain.
    #[must_use]
    pub const fn new(name: &'static str, domain: T::Domain) -> Self {
        Self { name, domain }
    }
}

/// What a person gave, before it is checked: a preset may depend on it.
#[derive(Debug, Clone, Copy)]
pub struct Given<'a>(&'a Map<String, Value>);

impl<'a> Given<'a> {
    /// The object as sent.
    #[must_use]
    pub fn new(object: &'a Map<String, Value>) -> Self {
        Self(object)
    }

    /// Whether the field is given.
    #[must_use]
    pub fn has<T: Parameter>(self, key: Key<T>) -> bool {
        self.0.contains_key(key.name)
    }

    /// The value of a field, if it is given and valid.
    #[must_use]
    pub fn read<T: Parameter>(self, key: Key<T>) -> Option<T> {
        T::parse(self.0.get(key.name)?, key.domain, "", &mut Vec::new())
    }

    /// The value of a field as sent; null where it is absent.
    #[must_use]
    pub fn raw<T: Parameter>(self, key: Key<T>) -> Value {
        self.0.get(key.name).cloned().unwrap_or_default()
    }

    /// Whether a choice is given by this name, whatever its fields.
    #[must_use]
    pub fn names<T: Choice + Parameter>(self, key: Key<T>, name: &str) -> bool {
        let given = self.0.get(key.name);
        given.is_some_and(|given| given.get("type").unwrap_or(given) == name)
    }

    /// Whether an object is given that has this field.
    #[must_use]
    pub fn has_inside<T: Parameter, F: Parameter>(self, key: Key<T>, field: Key<F>) -> bool {
        self.0.get(key.name).is_some_and(|given| given.get(field.name).is_some())
    }

    /// The value of a field of an object that is given, if it is there and valid.
    #[must_use]
    pub fn read_inside<T: Parameter, F: Parameter>(self, key: Key<T>, field: Key<F>) -> Option<F> {
        F::parse(self.0.get(key.name)?.get(field.name)?, field.domain, "", &mut Vec::new())
    }
}

/// Values of a preset.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Preset(Map<String, Value>);

impl Preset {
    /// Sets a field.
    #[must_use]
    pub fn set<T: Parameter>(mut self, key: Key<T>, value: impl Into<T>) -> Self {
        self.0.insert(key.name.to_owned(), value.into().to_json());
        self
    }

    /// Sets a field where `is_wanted`.
    #[must_use]
    pub fn set_if<T: Parameter>(self, is_wanted: bool, key: Key<T>, value: impl Into<T>) -> Self {
        if is_wanted { self.set(key, value) } else { self }
    }

    /// Sets every field of a group that stands among the others.
    #[must_use]
    pub fn set_all(mut self, fields: &impl Group) -> Self {
        fields.write_fields(&mut self.0);
        self
    }

    /// The preset over `given`: the fields of the preset win.
    #[must_use]
    pub fn over(self, mut given: Map<String, Value>) -> Map<String, Value> {
        given.extend(self.0);
        given
    }

    /// `given` over the preset: what is given wins; objects of the same `type` (or without one) are merged.
    #[must_use]
    pub fn under(self, given: Map<String, Value>) -> Map<String, Value> {
        merge(self.0, given)
    }
}

fn merge(preset: Map<String, Value>, given: Map<String, Value>) -> Map<String, Value> {
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
                Value::Object(merge(below.clone(), above))
            }
            (_, value) => value,
        };
        merged.insert(name, value);
    }
    merged
}
