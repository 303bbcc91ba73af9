//! `restart`: a scene taken from a checkpoint, with overrides of restart-safe fields.

use super::Sources;
use meniscus::scene::{Violation, check};
use serde_json::{Value, json};

/// Where the checkpoint of a restart lies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// With the job that wrote it.
    Checkpoint(String),
    /// Among the uploads.
    Upload(String),
}

impl Origin {
    /// The id.
    #[must_use]
    pub fn id(&self) -> &str {
        match self {
            Self::Checkpoint(id) | Self::Upload(id) => id,
        }
    }
}

/// The checkpoint that a restart begins with, as the store knows it.
#[derive(Debug, Clone)]
pub struct RestartSource {
    /// Where it lies.
    pub origin: Origin,
    /// The resolved body of the job that wrote it.
    pub resolved: Value,
    /// Instruction set it was written on.
    pub isa: String,
    /// Its step.
    pub step: u64,
}

/// The source and the scene of a restart: the checkpoint's scene with overrides of restart-safe fields.
pub(super) fn parse(
    restart: &Value,
    sources: &dyn Sources,
    errors: &mut Vec<Violation>,
) -> Option<(RestartSource, Value)> {
    const KNOWN: [&str; 4] = ["checkpoint", "upload", "overrides", "allow_other_isa"];
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
    let id = |name: &str| map.get(name).filter(|value| !value.is_null());
    let source = match (id("checkpoint"), id("upload")) {
        (Some(checkpoint), None) => checkpoint.as_str().and_then(|id| sources.checkpoint(id)).ok_or_else(|| {
            let allowed = json!("the id of a checkpoint, ckpt_…");
            Violation::new("/restart/checkpoint", "not_found", "there is no such checkpoint", checkpoint, allowed)
        }),
        (None, Some(upload)) => upload.as_str().and_then(|id| sources.uploaded_checkpoint(id)).ok_or_else(|| {
            let detail = "there is no such upload, or it is no checkpoint that passed its check";
            let allowed = json!("the id of an upload made with ?as=checkpoint that is ready, upl_…");
            Violation::new("/restart/upload", "not_found", detail, upload, allowed)
        }),
        (None, None) => {
            let detail = "a restart names a checkpoint or an upload";
            Err(Violation::new(
                "/restart/checkpoint",
                "required",
                detail,
                &Value::Null,
                json!("the id of a checkpoint, ckpt_…"),
            ))
        }
        (Some(_), Some(upload)) => {
            let detail = "a restart begins with a checkpoint or with an upload; give one of them";
            Err(Violation::new("/restart/upload", "conflict", detail, upload, Value::Null))
        }
    };
    let source = source.map_err(|violation| errors.push(violation)).ok()?;
    let allow = map.get("allow_other_isa").unwrap_or(&Value::Null);
    if !(allow.is_null() || allow.is_boolean()) {
        errors.push(Violation::new("/restart/allow_other_isa", "type", "true or false", allow, json!([true, false])));
    }
    if source.isa != crate::system::build::isa() && allow != &Value::Bool(true) {
        let detail = format!(
            "the checkpoint was written on {}, this service computes on {}; results would not be bit-identical",
            source.isa,
            crate::system::build::isa()
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
