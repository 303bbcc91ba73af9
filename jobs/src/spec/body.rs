//! The body of a job: as written by a client, and as understood with every default.

mod restart;
mod sources;
mod wishes;

pub use restart::{Origin, RestartSource};
pub use sources::{NoSources, Sources};
pub use wishes::{CheckpointWishes, Limits, Output, Wishes};

use crate::spec::forecast::{self, Forecast, WORKER_BASE_BYTES};
use meniscus::scene::schema::{NOT_NEGATIVE, POSITIVE};
use meniscus::scene::{CloudSizes, CloudSource, DefaultValue, Kind, Parameter, Scene, Violation, check, understand};
use meniscus::scenes::SCENES;
use meniscus::simulation::OutputPlan;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// What the machine and the operator allow.
#[derive(Debug, Clone, Copy)]
pub struct Allowance {
    /// Threads a job may ask for; also the default.
    pub threads: u64,
    /// Memory a job may ask for; also the default.
    pub memory_bytes: u64,
    /// Whether scenes may name files of this machine: the one who runs them in the foreground may read them anyway.
    pub local_files: bool,
}

/// A job body with every default, and its scene.
pub struct JobBody {
    /// The body as sent.
    pub spec: Value,
    /// The body with every default.
    pub resolved: Value,
    /// Name, for people.
    pub name: Option<String>,
    /// Labels, for filters.
    pub labels: BTreeMap<String, String>,
    /// Kind of the scene.
    pub kind: String,
    /// Higher goes first.
    pub priority: i64,
    /// The scene.
    pub scene: Box<dyn Scene>,
    /// What it will take.
    pub forecast: Forecast,
    /// The checkpoint that it starts from.
    pub origin: Option<Origin>,
    /// The uploads that its scene names.
    pub uploads: Vec<String>,
}

static OUTPUT: &[Parameter] = &[
    Parameter::restart_safe(
        "every_time",
        "a frame at every multiple of this time; first and last only when not given",
        POSITIVE,
        DefaultValue::Absent,
    ),
    Parameter::restart_safe(
        "series_every_steps",
        "a series row every so many steps",
        Kind::Integer { least: 1, most: u64::MAX },
        DefaultValue::Json("10"),
    ),
];

static CHECKPOINT: &[Parameter] = &[
    Parameter::restart_safe(
        "every_wall_s",
        "a checkpoint every so many seconds; 60 when neither it nor every_steps is given",
        POSITIVE,
        DefaultValue::Absent,
    ),
    Parameter::restart_safe(
        "every_steps",
        "a checkpoint every so many steps",
        Kind::Integer { least: 1, most: u64::MAX },
        DefaultValue::Absent,
    ),
    Parameter::restart_safe(
        "keep",
        "verified checkpoints to keep",
        Kind::Integer { least: 2, most: 1000 },
        DefaultValue::Json("2"),
    ),
];

static LIMITS: &[Parameter] = &[
    Parameter::restart_safe(
        "wall_s",
        "running time until the job is paused; it counts anew after a resume",
        POSITIVE,
        DefaultValue::Absent,
    ),
    Parameter::restart_safe(
        "memory_bytes",
        "resident memory of the worker",
        Kind::Integer { least: 1 << 20, most: u64::MAX },
        DefaultValue::Absent,
    ),
    Parameter::restart_safe(
        "disk_bytes",
        "size of all files of the job, checkpoints included",
        NOT_NEGATIVE,
        DefaultValue::Absent,
    ),
    Parameter::restart_safe(
        "threads",
        "threads of the worker",
        Kind::Integer { least: 1, most: 1024 },
        DefaultValue::Absent,
    ),
];

const FIELDS: [&str; 8] = ["name", "labels", "scene", "restart", "output", "checkpoint", "limits", "priority"];
const OUTPUT_FIELDS: [&str; 3] = ["every_time", "fields", "series_every_steps"];

/// From a client's JSON to a job.
///
/// `sources` knows the checkpoints and uploads that a body may name.
///
/// # Errors
/// All violations at once, with pointers from the body's root.
pub fn parse(spec: &Value, allowance: Allowance, sources: &dyn Sources) -> Result<JobBody, Vec<Violation>> {
    let Value::Object(given) = spec else {
        return Err(vec![Violation::new("", "type", "a job is an object", spec, json!("an object with a scene"))]);
    };
    let mut errors = Vec::new();
    for (name, value) in given {
        if !FIELDS.contains(&name.as_str()) {
            let at = format!("/{}", check::escaped(name));
            let mut violation = Violation::new(at, "unknown_field", "there is no such field", value, json!(FIELDS));
            violation.did_you_mean = check::closest(name, &FIELDS);
            errors.push(violation);
        }
    }
    let name = text(given, "name", &mut errors);
    let labels = labels(given, &mut errors);
    let priority = priority(given, &mut errors);
    let restart = match (given.get("scene"), given.get("restart")) {
        (None, None) => {
            let detail = "a job names a scene or a restart";
            errors.push(Violation::new("/scene", "required", detail, &Value::Null, json!("an object with a kind")));
            None
        }
        (Some(_), Some(restart)) => {
            let detail = "a restart takes its scene from the checkpoint; give one of them";
            errors.push(Violation::new("/restart", "conflict", detail, restart, Value::Null));
            None
        }
        (Some(_), None) => None,
        (None, Some(restart)) => restart::parse(restart, sources, &mut errors),
    };
    let scene_json = restart.as_ref().map(|(_, scene)| scene.clone()).or_else(|| given.get("scene").cloned());
    let prefix = if restart.is_some() { "/restart/overrides" } else { "/scene" };
    let scene = scene_json.and_then(|value| {
        understand(&value, SCENES).map_err(|found| errors.extend(found.into_iter().map(|v| v.under(prefix)))).ok()
    });
    let mut sizes = CloudSizes::new();
    let mut uploads = Vec::new();
    for cloud in scene.iter().flat_map(|scene| scene.clouds()) {
        match sources::size_of(&cloud, sources, allowance.local_files) {
            Ok(size) => sizes.extend(size.map(|size| (cloud.pointer, size))),
            Err(violation) => errors.push(violation.under(prefix)),
        }
        if let CloudSource::Upload(upload) = cloud.source {
            uploads.push(upload);
        }
    }
    let mut output = section(given, "output", OUTPUT, Some(&OUTPUT_FIELDS), &mut errors);
    let fields = output_fields(given, scene.as_deref(), &mut errors);
    output.insert("fields".into(), fields);
    let mut checkpoint = section(given, "checkpoint", CHECKPOINT, None, &mut errors);
    if checkpoint.get("every_wall_s").is_none_or(Value::is_null)
        && checkpoint.get("every_steps").is_none_or(Value::is_null)
    {
        checkpoint.insert("every_wall_s".into(), json!(60.0));
    }
    let mut limits = section(given, "limits", LIMITS, None, &mut errors);
    default_limit(&mut limits, "threads", allowance.threads, &mut errors);
    default_limit(&mut limits, "memory_bytes", allowance.memory_bytes, &mut errors);
    let estimate = scene.as_ref().map(|scene| scene.estimate(&sizes));
    if let (Some(estimate), Some(memory)) = (estimate, limits.get("memory_bytes").and_then(Value::as_u64)) {
        // An estimate is good within a quarter.
        let needed = WORKER_BASE_BYTES.saturating_add(estimate.memory_bytes).saturating_mul(5) / 4;
        if needed > memory {
            let detail = format!(
                "about {} particles need {needed} bytes, the limit is {memory} (/limits/memory_bytes); a larger spacing or a narrower band needs less",
                estimate.particles
            );
            let spacing = scene.as_ref().map_or(Value::Null, |s| s.resolved()["spacing"].clone());
            errors.push(Violation::new(
                format!("{prefix}/spacing"),
                "memory",
                detail,
                &spacing,
                json!(format!("≤ {memory} bytes")),
            ));
        }
    }
    if let (Some((source, _)), Some(estimate)) = (&restart, estimate)
        && estimate.steps < source.step
    {
        let detail = format!("the checkpoint is at step {}, this scene ends at step {}", source.step, estimate.steps);
        errors.push(Violation::new("/restart/overrides", "range", detail, &json!(estimate.end_time), Value::Null));
    }
    let (Some(scene), Some(estimate)) = (scene, estimate) else {
        return Err(errors);
    };
    if !errors.is_empty() {
        return Err(errors);
    }
    let threads = limits.get("threads").and_then(Value::as_u64).unwrap_or(1);
    let plan = OutputPlan {
        every_time: output.get("every_time").and_then(Value::as_f64),
        series_every_steps: output.get("series_every_steps").and_then(Value::as_u64).unwrap_or(10),
    };
    let of_scene = scene.resolved();
    let forecast = Forecast {
        estimate,
        work: scene.work(&estimate, &plan),
        family: scene.family(),
        threads,
        memory_bytes: WORKER_BASE_BYTES.saturating_add(estimate.memory_bytes),
        disk_bytes: forecast::disk_bytes(
            of_scene["dimension"].as_u64().unwrap_or(2),
            &estimate,
            &plan,
            &output,
            &checkpoint,
        ),
        time: None,
    };
    let mut resolved = Map::new();
    resolved.insert("name".into(), json!(name));
    resolved.insert("labels".into(), json!(labels));
    resolved.insert("scene".into(), of_scene);
    if let Some(restart) = given.get("restart") {
        resolved.insert("restart".into(), restart.clone());
    }
    resolved.insert("output".into(), Value::Object(output));
    resolved.insert("checkpoint".into(), Value::Object(checkpoint));
    resolved.insert("limits".into(), Value::Object(limits));
    resolved.insert("priority".into(), json!(priority));
    Ok(JobBody {
        spec: spec.clone(),
        kind: scene.resolved()["kind"].as_str().unwrap_or_default().to_owned(),
        resolved: Value::Object(resolved),
        name,
        labels,
        priority,
        scene,
        forecast,
        origin: restart.map(|(source, _)| source.origin),
        uploads,
    })
}

pub(crate) fn text(given: &Map<String, Value>, name: &str, errors: &mut Vec<Violation>) -> Option<String> {
    match given.get(name) {
        None | Some(Value::Null) => None,
        Some(Value::String(text)) if text.len() <= 200 => Some(text.clone()),
        Some(value) => {
            errors.push(Violation::new(
                format!("/{name}"),
                "type",
                "a text is needed",
                value,
                json!("a text of at most 200 bytes"),
            ));
            None
        }
    }
}

pub(crate) fn labels(given: &Map<String, Value>, errors: &mut Vec<Violation>) -> BTreeMap<String, String> {
    let mut labels = BTreeMap::new();
    match given.get("labels") {
        None | Some(Value::Null) => {}
        Some(Value::Object(map)) if map.len() <= 64 => {
            for (key, value) in map {
                match value.as_str() {
                    Some(text) if text.len() <= 200 && key.len() <= 100 => {
                        labels.insert(key.clone(), text.to_owned());
                    }
                    _ => {
                        let at = format!("/labels/{}", check::escaped(key));
                        errors.push(Violation::new(
                            at,
                            "type",
                            "a label is a text",
                            value,
                            json!("a text of at most 200 bytes"),
                        ));
                    }
                }
            }
        }
        Some(value) => {
            errors.push(Violation::new(
                "/labels",
                "type",
                "labels are an object of texts",
                value,
                json!("at most 64 texts by key"),
            ));
        }
    }
    labels
}

fn priority(given: &Map<String, Value>, errors: &mut Vec<Violation>) -> i64 {
    match given.get("priority") {
        None | Some(Value::Null) => 0,
        Some(value) => match value.as_i64() {
            Some(number) if (-100..=100).contains(&number) => number,
            _ => {
                errors.push(Violation::new(
                    "/priority",
                    "range",
                    "a priority is a whole number",
                    value,
                    json!("−100 to 100"),
                ));
                0
            }
        },
    }
}

fn section(
    given: &Map<String, Value>,
    name: &str,
    parameters: &[Parameter],
    known: Option<&[&str]>,
    errors: &mut Vec<Violation>,
) -> Map<String, Value> {
    let empty = Map::new();
    let section = match given.get(name) {
        None | Some(Value::Null) => &empty,
        Some(Value::Object(map)) => map,
        Some(value) => {
            errors.push(Violation::new(format!("/{name}"), "type", "an object is needed", value, Value::Null));
            &empty
        }
    };
    // `fields` depends on the scene and is checked apart.
    let mut rest = section.clone();
    if known.is_some() {
        rest.shift_remove("fields");
    }
    let before = errors.len();
    let checked = check(parameters, &rest, &format!("/{name}"), errors);
    if let Some(known) = known {
        for violation in &mut errors[before..] {
            if violation.code == "unknown_field" {
                let field = violation.pointer.rsplit('/').next().unwrap_or_default().to_owned();
                violation.did_you_mean = check::closest(&field, known);
                violation.allowed = json!(known);
            }
        }
    }
    checked
}

fn output_fields(given: &Map<String, Value>, scene: Option<&dyn Scene>, errors: &mut Vec<Violation>) -> Value {
    let known = scene.map(Scene::field_names).unwrap_or_default();
    match given.get("output").and_then(|output| output.get("fields")) {
        None | Some(Value::Null) => json!(known),
        Some(Value::Array(list)) => {
            for (k, value) in list.iter().enumerate() {
                let is_known = value.as_str().is_some_and(|name| known.contains(&name));
                if !is_known && scene.is_some() {
                    let detail = "the scene has no such field";
                    let mut violation =
                        Violation::new(format!("/output/fields/{k}"), "unknown", detail, value, json!(known));
                    violation.did_you_mean = value.as_str().and_then(|name| check::closest(name, &known));
                    errors.push(violation);
                }
            }
            Value::Array(list.clone())
        }
        Some(value) => {
            errors.push(Violation::new("/output/fields", "type", "a list of names is needed", value, json!(known)));
            Value::Null
        }
    }
}

fn default_limit(limits: &mut Map<String, Value>, name: &str, most: u64, errors: &mut Vec<Violation>) {
    match limits.get(name).and_then(Value::as_u64) {
        None => {
            limits.insert(name.to_owned(), json!(most));
        }
        Some(asked) if asked > most => {
            let detail = "more than this service gives to a job";
            errors.push(Violation::new(
                format!("/limits/{name}"),
                "range",
                detail,
                &json!(asked),
                json!(format!("at most {most}")),
            ));
        }
        Some(_) => {}
    }
}

#[cfg(test)]
mod tests;
