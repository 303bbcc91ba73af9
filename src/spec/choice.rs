//! Choices: one of several variants, each with fields of its own, and plain words.

use super::group::{self, Declaration};
use super::parameter::{Parameter, keyword};
use super::violation::Violation;
use serde_json::{Map, Value, json};

/// One of several variants, written as `{"type": NAME, …}`; a bare name stands for the variant with its defaults.
/// [`crate::choice!`] writes the implementation.
pub trait Choice: Sized + Clone {
    /// The field of the JSON object that names the variant.
    const TAG: &'static str = "type";

    /// The variant that an object without a tag stands for.
    const UNTAGGED: Option<&'static str> = None;

    /// Names of the variants, in the order of declaration.
    fn names() -> Vec<&'static str>;

    /// What each variant is.
    fn variants() -> Vec<Variant>;

    /// Reads the fields of the variant named `name`; None where there is no such variant, else what came of it.
    fn parse_variant(
        name: &str,
        given: &Map<String, Value>,
        place: &str,
        errors: &mut Vec<Violation>,
    ) -> Option<Option<Self>>;

    /// The variant's name.
    fn name(&self) -> &'static str;

    /// Adds the variant's fields to an object.
    fn write_fields(&self, object: &mut Map<String, Value>);
}

/// One variant of a choice, as people and programs see it.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// Its name: the `type` in JSON.
    pub name: &'static str,
    /// What it means.
    pub doc: String,
    /// Its fields.
    pub fields: Vec<Declaration>,
}

/// Reads a choice.
pub fn parse<T: Choice>(given: &Value, place: &str, errors: &mut Vec<Violation>) -> Option<T> {
    let empty = Map::new();
    let (name, fields, at) = match given {
        Value::String(name) => (Some(name.as_str()), &empty, place.to_owned()),
        Value::Object(fields) => {
            let name = match fields.get(T::TAG) {
                Some(tag) => tag.as_str(),
                None => T::UNTAGGED,
            };
            (name, fields, format!("{place}/{}", T::TAG))
        }
        _ => {
            let detail = format!("a choice is a name or an object with a {}", T::TAG);
            errors.push(Violation::new(place, "type", detail, given.clone(), T::names()));
            return None;
        }
    };
    let before = errors.len();
    let mut fields = fields.clone();
    fields.shift_remove(T::TAG);
    let found = name.and_then(|name| T::parse_variant(name, &fields, place, errors));
    let Some(found) = found else {
        let code = if name.is_some() { "unknown" } else { "required" };
        errors.push(Violation::unknown(at, code, "the choice is not known", json!(name), name, &T::names()));
        return None;
    };
    found.filter(|_| errors.len() == before)
}

/// The variant named `name` with the defaults that it declares: the default of a parameter says a name, not the
/// variant's fields a second time.
///
/// # Panics
///
/// Where there is no such variant or one of its fields has no default: a mistake in a declaration, met by whatever
/// reads the schema.
#[must_use]
pub fn with_defaults<T: Choice>(name: &str) -> T {
    let read = T::parse_variant(name, &Map::new(), "", &mut Vec::new()).flatten();
    let Some(variant) = read else {
        unreachable!("a default names a variant that needs fields or is not declared: {name}")
    };
    variant
}

/// A variant whose fields were all read, or none.
pub fn when_complete<T>(variant: impl FnOnce() -> Option<T>) -> Option<T> {
    variant()
}

/// The schema of a choice.
#[must_use]
pub fn schema<T: Choice>() -> Map<String, Value> {
    let variants = T::variants();
    let is_complete = |v: &&Variant| v.fields.iter().all(|field| !field.is_required);
    let bare: Vec<&str> = variants.iter().filter(is_complete).map(|v| v.name).collect();
    let mut options: Vec<Value> = variants
        .iter()
        .map(|variant| {
            let mut schema = group::schema(&variant.fields);
            if let Some(Value::Object(properties)) = schema.get_mut("properties") {
                properties.shift_insert(0, T::TAG.into(), json!({"const": variant.name}));
            }
            if let Some(Value::Array(required)) = schema.get_mut("required")
                && T::UNTAGGED != Some(variant.name)
            {
                required.insert(0, json!(T::TAG));
            }
            schema.insert("description".into(), json!(variant.doc));
            Value::Object(schema)
        })
        .collect();
    if !bare.is_empty() {
        options.push(json!({"enum": bare, "description": "a bare name stands for the choice with its defaults"}));
    }
    keyword("anyOf", options)
}

/// A choice as JSON, every field written out.
#[must_use]
pub fn to_json<T: Choice>(choice: &T) -> Value {
    let mut object = keyword(T::TAG, choice.name());
    choice.write_fields(&mut object);
    Value::Object(object)
}

/// A least length of a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AtLeast(pub usize);

impl<T: Choice> Parameter for Vec<T> {
    type Domain = AtLeast;

    fn any() -> AtLeast {
        AtLeast(0)
    }

    fn parse(given: &Value, AtLeast(least): AtLeast, place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let Some(list) = given.as_array().filter(|list| list.len() >= least) else {
            let detail = "a list of choices is needed";
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(AtLeast(least))));
            return None;
        };
        let items: Vec<Option<T>> =
            list.iter().enumerate().map(|(k, item)| parse(item, &format!("{place}/{k}"), errors)).collect();
        items.into_iter().collect()
    }

    fn allowed(AtLeast(least): AtLeast) -> Value {
        json!({"at_least": least, "each": T::names()})
    }

    fn schema(AtLeast(least): AtLeast) -> Map<String, Value> {
        let mut list = keyword("type", "array");
        list.insert("minItems".into(), json!(least));
        list.insert("items".into(), Value::Object(schema::<T>()));
        list
    }

    fn to_json(&self) -> Value {
        self.iter().map(to_json).collect()
    }
}

/// One of several words. [`crate::words!`] writes the implementation.
pub trait Word: Sized + Copy + PartialEq + 'static {
    /// The words with their values.
    const WORDS: &'static [(&'static str, Self)];

    /// The word of the value.
    #[must_use]
    fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, value)| *value == self).map_or("", |(word, _)| word)
    }

    /// The value of a word.
    #[must_use]
    fn from_word(word: &str) -> Option<Self> {
        Self::WORDS.iter().find(|(known, _)| *known == word).map(|(_, value)| *value)
    }
}

/// All words of a type.
#[must_use]
pub fn words<T: Word>() -> Vec<&'static str> {
    T::WORDS.iter().map(|(word, _)| *word).collect()
}

/// Reads a word.
pub fn parse_word<T: Word>(given: &Value, place: &str, errors: &mut Vec<Violation>) -> Option<T> {
    let word = given.as_str();
    let found = word.and_then(T::from_word);
    if found.is_none() {
        let detail = "one of the known words is needed";
        errors.push(Violation::unknown(place, "unknown", detail, given.clone(), word, &words::<T>()));
    }
    found
}
