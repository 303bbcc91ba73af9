//! `restart`: a scene taken from a checkpoint, with overrides of restart-safe fields.

use meniscus::scene::{Violation, check};
use serde_json::{Value, json};

/// The checkpoint that a restart begins with, as the store knows it.
#[derive(Debug, Clone)]
pub struct RestartSource {
    /// Its id.
    pub checkpoint: String,
    /// The resolved body of the job that wrote it.
    pub resolved: Value,
    /// Its job.
    pub job: String,
    /// Instruction set it was written on.
    pub isa: String,
    /// Its step.
    pub step: u64,
}

/// The source and the scene of a restart: the checkpoint's scene with overrides of restart-safe fields.
pub(super) fn parse(
    restart: &Value,
    find_checkpoint: &mut impl FnMut(&str) -> Option<RestartSource>,
    errors: &mut Vec<Violation>,
) -> Option<(RestartSource, Value)> {
    const KNOWN: [&str; 3] = ["checkpoint", "overrides", "allow_other_isa"];
    let Value::Object(map) = restart else {
        errors.push(Violation::new("/restart", "type", "a restart is an object", restart, json!(KNOWN)));
        return None;
    };
    for (name, value) in map {
        if !KNOWN.contains(&name.as_str()) {
            let at = format!("/restart/{}", check::escaped(name));
            let mut violation = Violation::new(at, "unknown_field", "there is no such field", value, json!(KNOWN));
            violation.did_you_mean = check::closest(name, &KNOWN);
            errors.push(violation);
        }
    }
    let id = map.get("checkpoint").unwrap_or(&Value::Null);
    let Some(source) = id.as_str().and_then(find_checkpoint) else {
        let code = if id.is_null() { "required" } else { "not_found" };
        let detail = "there is no such checkpoint";
        errors.push(Violation::new("/restart/checkpoint", code, detail, id, json!("the id of a checkpoint, ckpt_…")));
        return None;
    };
    let allow = map.get("allow_other_isa").unwrap_or(&Value::Null);
    if !(allow.is_null() || allow.is_boolean()) {
        errors.push(Violation::new("/restart/allow_other_isa", "type", "true or false", allow, json!([true, false])));
    }
    if source.isa != crate::build::isa() && allow != &Value::Bool(true) {
        let detail = format!(
            "the checkpoint was written on {}, this service computes on {}; results would not be bit-identical",
            source.isa,
            crate::build::isa()
        );
        errors.push(Violation::new("/restart/allow_other_isa", "required", detail, allow, json!([true])));
    }
    let mut scene = source.resolved["scene"].clone();
    let kind = scene["kind"].as_str().and_then(meniscus::scenes::find)?;
    let safe = meniscus::scene::json_schema::restart_safe(kind);
    match map.get("overrides") {
        None | Some(Value::Null) => {}
        Some(Value::Object(overrides)) => {
            for (pointer, value) in overrides {
                let at = format!("/restart/overrides/{}", check::escaped(pointer));
                if !safe.contains(pointer) {
                    let detail = "a restart may not change this field";
                    let mut violation = Violation::new(at, "not_restart_safe", detail, value, json!(safe));
                    let names: Vec<&str> = safe.iter().map(String::as_str).collect();
                    violation.did_you_mean = check::closest(pointer, &names);
                    errors.push(violation);
                } else if let Some(slot) = scene.pointer_mut(pointer) {
                    *slot = value.clone();
                }
            }
        }
        Some(value) => {
            let detail = "overrides are an object from JSON pointers to values";
            errors.push(Violation::new("/restart/overrides", "type", detail, value, json!(safe)));
        }
    }
    Some((source, scene))
}
