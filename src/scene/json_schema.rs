//! JSON Schema 2020-12 from declared parameters.

use super::SceneKind;
use super::schema::{Default, Kind, Parameter, Variant};
use serde_json::{Map, Value, json};

/// The schema of a kind of scene: defaults, ranges, and `x-restart-safe` on what a restart may change.
#[must_use]
pub fn of_kind(kind: &SceneKind) -> Value {
    let mut schema = object(kind.parameters);
    let mut properties = Map::new();
    properties.insert("kind".into(), json!({"const": kind.kind}));
    if !kind.presets.is_empty() {
        let description = "sets every parameter that the paper states; anything given beside it wins";
        properties.insert("preset".into(), json!({"enum": kind.presets, "description": description}));
    }
    if let Some(Value::Object(rest)) = schema.get_mut("properties").map(Value::take) {
        properties.extend(rest);
    }
    if let Some(required) = schema.get_mut("required").and_then(Value::as_array_mut) {
        required.insert(0, json!("kind"));
    }
    schema.insert("properties".into(), Value::Object(properties));
    let mut whole = Map::new();
    whole.insert("$schema".into(), json!("https://json-schema.org/draft/2020-12/schema"));
    whole.insert("title".into(), json!(kind.title));
    whole.append(&mut schema);
    Value::Object(whole)
}

/// Pointers to the fields of a kind that a restart may change.
#[must_use]
pub fn restart_safe(kind: &SceneKind) -> Vec<String> {
    kind.parameters.iter().filter(|p| p.restart_safe).map(|p| format!("/{}", p.name)).collect()
}

fn object(parameters: &[Parameter]) -> Map<String, Value> {
    let required: Vec<&str> = parameters.iter().filter(|p| p.default == Default::Required).map(|p| p.name).collect();
    let properties: Map<String, Value> = parameters.iter().map(|p| (p.name.to_owned(), property(p))).collect();
    let mut schema = Map::new();
    schema.insert("type".into(), json!("object"));
    schema.insert("properties".into(), Value::Object(properties));
    schema.insert("required".into(), json!(required));
    schema.insert("additionalProperties".into(), json!(false));
    schema
}

fn property(parameter: &Parameter) -> Value {
    let mut schema = of_value(&parameter.kind);
    if matches!(parameter.default, Default::Absent | Default::JsonOrNull(_)) {
        schema = Map::from_iter([("anyOf".to_owned(), json!([schema, {"type": "null"}]))]);
    }
    schema.insert("description".into(), json!(parameter.doc));
    if let Default::Json(text) | Default::JsonOrNull(text) = parameter.default {
        schema.insert("default".into(), serde_json::from_str(text).unwrap_or(Value::Null));
    }
    if parameter.restart_safe {
        schema.insert("x-restart-safe".into(), json!(true));
    }
    Value::Object(schema)
}

fn of_value(kind: &Kind) -> Map<String, Value> {
    let value = match kind {
        Kind::Number { above, least, below, most } => {
            let mut schema = Map::from_iter([("type".to_owned(), json!("number"))]);
            let bounds =
                [("exclusiveMinimum", above), ("minimum", least), ("exclusiveMaximum", below), ("maximum", most)];
            for (name, bound) in bounds {
                if let Some(bound) = bound {
                    schema.insert(name.into(), json!(bound));
                }
            }
            return schema;
        }
        Kind::Integer { least, most } if *most == u64::MAX => {
            json!({"type": "integer", "minimum": least})
        }
        Kind::Integer { least, most } => {
            json!({"type": "integer", "minimum": least, "maximum": most})
        }
        Kind::Vector { positive } => {
            let item =
                if *positive { json!({"type": "number", "exclusiveMinimum": 0}) } else { json!({"type": "number"}) };
            json!({"type": "array", "items": item, "minItems": 2, "maxItems": 3})
        }
        Kind::Choice(variants) => choice(variants()),
        Kind::Group(parameters) => return object(parameters),
        Kind::Choices { variants, least } => {
            json!({"type": "array", "minItems": least, "items": choice(variants())})
        }
        Kind::Text => json!({"type": "string", "minLength": 1}),
        Kind::Flag => json!({"type": "boolean"}),
        Kind::Word(words) => json!({"enum": words}),
    };
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

fn choice(variants: &[Variant]) -> Value {
    let complete = |v: &&Variant| v.parameters.iter().all(|p| p.default != Default::Required);
    let bare: Vec<&str> = variants.iter().filter(complete).map(|v| v.name).collect();
    let mut options: Vec<Value> = variants
        .iter()
        .map(|variant| {
            let mut schema = object(variant.parameters);
            if let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) {
                properties.shift_insert(0, "type".into(), json!({"const": variant.name}));
            }
            if let Some(required) = schema.get_mut("required").and_then(Value::as_array_mut) {
                required.insert(0, json!("type"));
            }
            schema.insert("description".into(), json!(variant.doc));
            Value::Object(schema)
        })
        .collect();
    if !bare.is_empty() {
        options.push(json!({"enum": bare, "description": "a bare name stands for the choice with its defaults"}));
    }
    json!({"anyOf": options})
}
