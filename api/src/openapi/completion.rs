//! What the routes cannot say of themselves: request bodies made from the declared parameters, descriptions of responses, media
//! types of streams and files, and tokens.

use meniscus::scene::SceneKind;
use meniscus::scenes::SCENES;
use meniscus::spec::{Group, Parameter, group};
use meniscus_jobs::spec::body::JobSpec;
use meniscus_jobs::spec::study::StudySpec;
use serde_json::{Map, Value, json};
use utoipa::openapi::OpenApi;

/// Responses that mean the same wherever they occur.
const RESPONSES: [(&str, &str); 14] = [
    ("201", "It was created; `Location` holds its address."),
    ("202", "The request was accepted and will be carried out."),
    ("204", "It was done; there is nothing to answer."),
    ("206", "The part of the content that `Range` asks for."),
    ("304", "The copy of the client is up to date."),
    ("307", "`Location` holds the address."),
    ("404", "There is no such resource."),
    ("409", "The state of the resource does not allow this."),
    ("413", "The body is larger than the limit."),
    ("415", "The format of the file is not known."),
    ("416", "The range lies outside the content."),
    ("422", "The request was read but is wrong; `errors` lists everything."),
    ("429", "There are too many requests or jobs; `Retry-After` says when to try again."),
    ("507", "There is not enough free space."),
];

/// Media types that a successful answer can have beside the one that the route names: path, media type, schema.
fn media_types() -> Vec<(&'static str, &'static str, Value)> {
    let text = json!({"type": "string"});
    let bytes = json!({"type": "string", "format": "binary"});
    let rows = json!({"type": "object", "properties": {
        "columns": {"type": "array", "items": {"type": "string"}},
        "rows": {"type": "array", "items": {"type": "object", "additionalProperties": true}},
    }});
    vec![
        ("/v1/jobs/{id}/events", "text/event-stream", text.clone()),
        ("/v1/studies/{id}/events", "text/event-stream", text.clone()),
        ("/v1/jobs/{id}/log", "text/plain", text.clone()),
        ("/v1/jobs/{id}/series", "text/csv", text.clone()),
        ("/v1/jobs/{id}/series", "application/json", rows),
        ("/v1/jobs/{id}/files/{path}", "application/octet-stream", bytes.clone()),
        ("/v1/jobs/{id}/files/{path}", "application/x-hdf5", bytes.clone()),
        ("/v1/jobs/{id}/files/{path}", "application/json", json!({})),
        ("/v1/jobs/{id}/files/{path}", "text/csv", text.clone()),
        ("/v1/jobs/{id}/files/{path}", "text/plain", text.clone()),
        ("/v1/jobs/{id}/files/{path}", "image/svg+xml", text.clone()),
        ("/v1/jobs/{id}/files.tar", "application/x-tar", bytes.clone()),
        ("/v1/checkpoints/{id}/content", "application/x-hdf5", bytes),
        ("/v1/studies/{id}/report", "image/svg+xml", text),
    ]
}

/// The whole document as JSON.
#[must_use]
pub fn complete(document: OpenApi) -> Value {
    let mut document = serde_json::to_value(document).unwrap_or_default();
    add_schemas(&mut document);
    for (path, body, examples) in [
        ("/v1/jobs", "JobSpec", job_examples()),
        ("/v1/estimates", "JobSpec", job_examples()),
        ("/v1/studies", "StudySpec", study_examples()),
    ] {
        let schema = json!({"$ref": reference(body)});
        document["paths"][path]["post"]["requestBody"] =
            json!({"required": true, "content": {"application/json": {"schema": schema, "examples": examples}}});
    }
    for (path, media_type, schema) in media_types() {
        document["paths"][path]["get"]["responses"]["200"]["content"][media_type] = json!({"schema": schema});
    }
    describe_responses(&mut document);
    let scheme =
        json!({"type": "http", "scheme": "bearer", "description": "a token of the service, where it asks for one"});
    document["components"]["securitySchemes"] = json!({"token": scheme});
    // On loopback no token is needed.
    document["security"] = json!([{}, {"token": []}]);
    document
}

fn reference(schema: &str) -> String {
    format!("#/components/schemas/{schema}")
}

/// The name of the schema of a kind of scene: `VortexScene`.
fn schema_name(kind: &SceneKind) -> String {
    let words = kind.kind.split('_');
    let capitalized = words.map(|word| word[..1].to_uppercase() + &word[1..]);
    capitalized.chain(std::iter::once("Scene".to_owned())).collect()
}

/// Schemas of scenes, jobs and studies. A choice of scenes is a `oneOf` by `kind`.
fn add_schemas(document: &mut Value) {
    let schemas = &mut document["components"]["schemas"];
    let mut options = Vec::new();
    let mut mapping = Map::new();
    for kind in SCENES {
        let (name, mut schema) = (schema_name(kind), kind.json_schema());
        if let Value::Object(map) = &mut schema {
            map.shift_remove("$schema");
        }
        options.push(json!({"$ref": reference(&name)}));
        mapping.insert(kind.kind.to_owned(), json!(reference(&name)));
        schemas[name] = schema;
    }
    let discriminator = json!({"propertyName": "kind", "mapping": mapping});
    schemas["Scene"] = json!({"oneOf": options, "discriminator": discriminator});
    schemas["JobSpec"] = Value::Object(JobSpec::schema(()));
    schemas["JobSpec"]["properties"]["scene"] = json!({"$ref": reference("Scene")});
    schemas["StudySpec"] = Value::Object(group::schema(&StudySpec::declarations()));
    schemas["StudySpec"]["properties"]["base"] = json!({"$ref": reference("JobSpec")});
    schemas["StudySpec"]["required"] = json!(["base", "sweep"]);
    move_defaults(schemas);
}

/// Generators of clients take defaults that are words or numbers. Others stand beside them, as `x-default`.
fn move_defaults(schema: &mut Value) {
    match schema {
        Value::Object(map) => {
            if map.get("default").is_some_and(|default| default.is_object() || default.is_array()) {
                let default = map.shift_remove("default").unwrap_or_default();
                map.insert("x-default".to_owned(), default);
            }
            map.values_mut().for_each(move_defaults);
        }
        Value::Array(list) => list.iter_mut().for_each(move_defaults),
        _ => {}
    }
}

/// The example of each kind of scene.
fn job_examples() -> Value {
    let example = |kind: &&SceneKind| {
        // The examples are part of the program; a test runs them.
        let value: Value = serde_json::from_str(kind.example).unwrap_or_default();
        (kind.kind.to_owned(), json!({"summary": kind.title, "value": value}))
    };
    Value::Object(SCENES.iter().map(example).collect())
}

fn study_examples() -> Value {
    let base = json!({"scene": {"kind": "redistance", "method": {"type": "pcp"}}});
    let axes = json!({"/scene/spacing": [0.04, 0.02, 0.01], "/scene/method/degree": [3, 4]});
    let value = json!({"base": base, "sweep": {"mode": "grid", "axes": axes}, "max_parallel": 2});
    json!({"grid": {"summary": "Errors over spacing for two degrees", "value": value}})
}

/// A success is described by what the operation does, every other response by what its status means.
fn describe_responses(document: &mut Value) {
    let paths = document["paths"].as_object_mut().into_iter().flatten();
    for operation in paths.filter_map(|(_, item)| item.as_object_mut()).flat_map(|item| item.values_mut()) {
        let summary = operation["summary"].as_str().unwrap_or("The answer.").to_owned();
        for (status, response) in operation["responses"].as_object_mut().into_iter().flatten() {
            let is_described = response["description"].as_str().is_some_and(|text| !text.is_empty());
            if !is_described {
                let known = RESPONSES.iter().find(|(known, _)| known == status);
                response["description"] = json!(known.map_or(summary.as_str(), |(_, text)| text));
            }
        }
    }
}
