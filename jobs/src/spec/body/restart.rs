//! `restart`: a scene taken from a checkpoint, with overrides of restart-safe fields.

use super::sources::{JobSource, Origin, RestartSource, Sources};
use meniscus::spec::{Given, Json, Object, Parameter, Violation, escape};
use serde_json::json;

meniscus::group! {
    /// A scene taken from a checkpoint.
    pub struct RestartSpec {
        /// id of a checkpoint
        checkpoint: Option<String>;
        /// id of an upload that was made as a checkpoint and is ready
        upload: Option<String>;
        /// id of a job whose last checkpoint is taken; where it has not ended, this job starts after it
        job: Option<String>;
        /// new values of fields that a restart may change, by JSON pointers into the scene
        overrides: Option<Overrides>;
        /// whether a checkpoint of another instruction set may be used; results are then not bit-identical
        allow_other_isa: Option<bool>;
    }
}

/// New values by JSON pointers.
#[derive(Debug, Clone, PartialEq)]
pub struct Overrides(pub Object);

impl Parameter for Overrides {
    type Domain = ();

    fn any() {}

    fn parse(given: &Json, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let map = given.as_object().cloned().map(Self);
        if map.is_none() {
            let detail = "overrides are an object from JSON pointers to values";
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(())));
        }
        map
    }

    fn allowed((): ()) -> Json {
        json!({"/end_time": 12.0})
    }

    fn schema((): ()) -> Object {
        Object::from_iter([("type".to_owned(), json!("object"))])
    }

    fn to_json(&self) -> Json {
        Json::Object(self.0.clone())
    }
}

/// The source and the scene of a restart: the checkpoint's scene with overrides of restart-safe fields. Fields are read one by
/// one: an error in one of them, which is listed already, does not hide those of others.
///
/// # Errors
/// When the look-up fails.
pub(super) fn scene<S: Sources>(
    given: Given,
    sources: &S,
    errors: &mut Vec<Violation>,
) -> Result<Option<(RestartSource, Json)>, S::Error> {
    let spec = RestartSpec {
        checkpoint: given.read(RestartSpec::checkpoint()).flatten(),
        upload: given.read(RestartSpec::upload()).flatten(),
        job: given.read(RestartSpec::job()).flatten(),
        overrides: given.read(RestartSpec::overrides()).flatten(),
        allow_other_isa: given.read(RestartSpec::allow_other_isa()).flatten(),
    };
    let source = source(&spec, sources)?.map_err(|error| errors.push(error)).ok();
    Ok(source.and_then(|source| overridden(&spec, source, errors)))
}

fn overridden(spec: &RestartSpec, source: RestartSource, errors: &mut Vec<Violation>) -> Option<(RestartSource, Json)> {
    let own = crate::system::build::isa();
    if source.isa != own && spec.allow_other_isa != Some(true) {
        let detail = format!(
            "the checkpoint was written on {}, this service computes on {own}; results would not be bit-identical",
            source.isa
        );
        let got = spec.allow_other_isa.to_json();
        errors.push(Violation::new("/restart/allow_other_isa", "required", detail, got, json!([true])));
    }
    let mut scene = source.scene.clone();
    let kind = meniscus::scenes::kind_of(&scene)?;
    let safe = kind.restart_safe();
    for (pointer, value) in spec.overrides.iter().flat_map(|overrides| &overrides.0) {
        if !safe.contains(pointer) {
            let at = format!("/restart/overrides/{}", escape(pointer));
            let names: Vec<&str> = safe.iter().map(String::as_str).collect();
            let detail = "a restart may not change this field";
            errors.push(Violation::unknown(at, "not_restart_safe", detail, value.clone(), Some(pointer), &names));
        } else if let Some(slot) = scene.pointer_mut(pointer) {
            *slot = value.clone();
        }
    }
    Some((source, scene))
}

fn source<S: Sources>(spec: &RestartSpec, sources: &S) -> Result<Result<RestartSource, Violation>, S::Error> {
    let by_checkpoint = "the id of a checkpoint, ckpt_…";
    Ok(match (&spec.checkpoint, &spec.upload, &spec.job) {
        (Some(id), None, None) => sources.checkpoint(id)?.ok_or_else(|| {
            let detail = "there is no such checkpoint";
            Violation::new("/restart/checkpoint", "not_found", detail, id.as_str(), by_checkpoint)
        }),
        (None, Some(id), None) => sources.uploaded_checkpoint(id)?.ok_or_else(|| {
            let detail = "there is no such upload, or it is no checkpoint that passed its check";
            let allowed = "the id of an upload that was made as a checkpoint and is ready, upl_…";
            Violation::new("/restart/upload", "not_found", detail, id.as_str(), allowed)
        }),
        (None, None, Some(id)) => last_checkpoint(id, sources.job(id)?),
        (None, None, None) => {
            let detail = "a restart names a checkpoint, an upload or a job";
            Err(Violation::new("/restart/checkpoint", "required", detail, Json::Null, by_checkpoint))
        }
        (_, upload, job) => {
            let detail = "a restart begins with a checkpoint, an upload or a job; give one of them";
            let (at, id) = match (upload, job) {
                (_, Some(id)) => ("/restart/job", id.as_str()),
                (upload, None) => ("/restart/upload", upload.as_deref().unwrap_or_default()),
            };
            Err(Violation::new(at, "conflict", detail, id, Json::Null))
        }
    })
}

/// The last checkpoint of a job, or the one that it will have when it has succeeded.
fn last_checkpoint(id: &str, job: Option<JobSource>) -> Result<RestartSource, Violation> {
    let refused = |code, detail: &str| {
        Violation::new(
            "/restart/job",
            code,
            detail,
            id,
            "the id of a job with a checkpoint, or of one that may still succeed",
        )
    };
    let job = job.ok_or_else(|| refused("not_found", "there is no such job"))?;
    if job.state.is_terminal() {
        return job.checkpoint.ok_or_else(|| refused("conflict", "the job has ended and has no checkpoint"));
    }
    let (origin, isa) = (Origin::Job(id.to_owned()), crate::system::build::isa());
    Ok(RestartSource { origin, scene: job.scene, isa, step: 0 })
}
