//! The body of a job: as a client writes it, and with every default.

mod amendment;
mod fields;
mod predecessors;
mod restart;
mod sources;

pub use amendment::{Amended, AmendmentSpec, amend};
pub use fields::{Labels, Name, Priority};
pub use predecessors::JobIds;
pub use restart::RestartSpec;
pub use sources::{BodyError, JobSource, NoSources, Origin, RestartSource, Sources};

use crate::spec::accuracy::{AccuracySpec, ChosenAccuracy, Wanted};
use crate::spec::forecast::{self, Forecast, WORKER_BASE_BYTES};
use crate::spec::own_measures::{Kept, OwnMeasures};
use crate::spec::run_options::{CheckpointSpec, Checkpoints, Limits, LimitsSpec, Output, OutputSpec, RunOptions};
use meniscus::scene::{self, CloudSizes, CloudSource, Estimate, Scene};
use meniscus::scenes::SCENES;
use meniscus::spec::{Given, Group, Json, Parameter, Raw, Violation, group};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;

meniscus::group! {
    /// A job.
    pub struct JobSpec {
        /// name, for people
        name: Option<Name>;
        /// labels, for filters
        labels: Option<Labels>;
        /// the scene: an object with a kind and its parameters
        scene: Raw = Raw::default();
        /// a scene taken from a checkpoint, instead of `scene`
        restart: Option<RestartSpec>;
        /// what to write
        output: Option<OutputSpec>;
        /// when to write checkpoints
        checkpoint: Option<CheckpointSpec>;
        /// limits of the run
        limits: Option<LimitsSpec>;
        /// rank in the queue: higher goes first
        priority: Option<Priority>;
        /// ids of jobs that must have succeeded before this one starts
        after: Option<JobIds>;
        /// an error that is asked for; the service then chooses the spacing, or the count of points
        accuracy: Option<AccuracySpec>;
    }
}

/// What the machine and the operator allow.
#[derive(Debug, Clone, Copy)]
pub struct Allowance {
    /// Threads a job may ask for; also the default.
    pub threads: u64,
    /// Memory a job may ask for, in bytes; also the default.
    pub memory_bytes: u64,
    /// Whether scenes may name files of this machine, as in the foreground, where the user may read those anyway.
    pub local_files: bool,
}

/// A body with everything filled in, as it stands in the store and in answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResolvedBody {
    /// Name, for people.
    pub name: Option<String>,
    /// Labels, for filters.
    pub labels: BTreeMap<String, String>,
    /// The resolved scene.
    pub scene: Value,
    /// The restart as sent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub restart: Option<Value>,
    /// Output, checkpoints and limits.
    #[serde(flatten)]
    pub options: RunOptions,
    /// Rank in the queue.
    pub priority: i64,
    /// The accuracy that was asked for, once the spacing is chosen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<ChosenAccuracy>,
}

impl ResolvedBody {
    /// The body as JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        // Texts, numbers and JSON always have a JSON form.
        serde_json::to_value(self).unwrap_or_default()
    }
}

/// The scene of a resolved body as it stands in a row or in a checkpoint, of earlier builds too.
///
/// # Errors
/// When it has none.
pub fn resolved_scene(body: &Value) -> Result<Value, serde_json::Error> {
    #[derive(Deserialize)]
    struct SceneAlone {
        scene: Value,
    }
    let scene = SceneAlone::deserialize(body)?.scene;
    Ok(scene::of_earlier_version(scene, SCENES))
}

/// A valid job body with every default, and its scene.
pub struct JobBody {
    /// The body as sent.
    pub spec: Value,
    /// The body with every default.
    pub resolved: ResolvedBody,
    /// Kind of the scene.
    pub kind: String,
    /// The scene.
    pub scene: Box<dyn Scene>,
    /// What it will take.
    pub forecast: Forecast,
    /// The checkpoint that it starts from.
    pub origin: Option<Origin>,
    /// The uploads that its scene names.
    pub uploads: Vec<String>,
    /// Jobs that must have succeeded before it starts.
    pub predecessors: Vec<String>,
    /// An accuracy that is asked for: the scene then is the one with the default spacing, which is still to be chosen.
    pub wanted: Option<Wanted>,
}

/// From a client's JSON to a job.
///
/// Steps: every field by itself; the scene, or the one of the checkpoint; points from outside; fields of frames and limits, by what
/// the scene and the machine allow.
///
/// `sources` knows the checkpoints and uploads that a body may name.
///
/// # Errors
/// Everything that is wrong at once, with pointers from the body's root, or a failed look-up.
pub fn parse<S: Sources>(spec: &Value, allowance: Allowance, sources: &S) -> Result<JobBody, BodyError<S::Error>> {
    let Value::Object(object) = spec else {
        let allowed = "an object with a scene";
        return Err(vec![Violation::new("", "type", "a job is an object", spec.clone(), allowed)].into());
    };
    let mut errors = Vec::new();
    group::check_names(object, &JobSpec::names(), "", &mut errors);
    let parsed = JobSpec::parse_fields(object, "", &mut errors);
    // What follows reads single fields, so that an error in one of them does not hide those of others.
    let given = Given::new(object);
    let start = start(given, sources, &mut errors).map_err(BodyError::Lookup)?;
    let (scene, uploads, sizes) = planned_scene(&start, allowance, sources, &mut errors).map_err(BodyError::Lookup)?;
    let fields = field_names(given, scene.as_deref(), &mut errors);
    let limits = limits(given, allowance, &mut errors);
    let estimate = scene.as_ref().map(|scene| scene.estimate(&sizes));
    if let (Some(scene), Some(estimate), Some(limits)) = (&scene, estimate, &limits) {
        errors.extend(check_operators(given, scene.as_ref(), &estimate));
        errors.extend(check_measures(given, scene.as_ref()));
        errors.extend(check_memory(start.prefix, scene.as_ref(), &estimate, limits.memory_bytes));
    }
    if let (Some(source), Some(estimate)) = (&start.source, estimate) {
        errors.extend(check_end(source, &estimate));
    }
    let mut predecessors = given.read(JobSpec::after()).flatten().unwrap_or_default().0;
    predecessors::check(&predecessors, sources, &mut errors).map_err(BodyError::Lookup)?;
    let wanted = wanted(given, &start, scene.as_deref(), &mut errors);
    let (Some(parsed), Some(scene), Some(estimate), Some(limits)) = (parsed, scene, estimate, limits) else {
        return Err(errors.into());
    };
    if !errors.is_empty() {
        return Err(errors.into());
    }
    let options = run_options(&parsed, fields, limits);
    let forecast = forecast(scene.as_ref(), estimate, &options);
    let resolved = ResolvedBody {
        name: parsed.name.map(|name| name.0),
        labels: parsed.labels.unwrap_or_default().0,
        scene: scene.resolved(),
        restart: parsed.restart.map(|restart| restart.to_json()),
        options,
        priority: parsed.priority.unwrap_or_default().0,
        accuracy: None,
    };
    let origin = start.source.map(|source| source.origin);
    if let Some(Origin::Job(job)) = &origin
        && !predecessors.contains(job)
    {
        predecessors.push(job.clone());
    }
    let (spec, kind) = (spec.clone(), scene.kind().to_owned());
    Ok(JobBody { spec, kind, resolved, scene, forecast, origin, uploads, predecessors, wanted })
}

/// The accuracy that is asked for.
fn wanted(given: Given, start: &SceneStart, scene: Option<&dyn Scene>, errors: &mut Vec<Violation>) -> Option<Wanted> {
    let spec = given.read(JobSpec::accuracy()).flatten()?;
    if given.has(JobSpec::restart()) {
        let detail = "a restart has the spacing of its checkpoint";
        errors.push(Violation::new("/accuracy", "conflict", detail, spec.to_json(), Value::Null));
    }
    Wanted::new(spec, start.scene.as_ref(), scene?, errors)
}

/// Where the scene of a job comes from.
struct SceneStart {
    scene: Option<Json>,
    source: Option<RestartSource>,
    /// What stands before the pointers of the scene's errors.
    prefix: &'static str,
}

fn start<S: Sources>(given: Given, sources: &S, errors: &mut Vec<Violation>) -> Result<SceneStart, S::Error> {
    let scene = given.read(JobSpec::scene()).and_then(|raw| raw.0);
    let own = |scene| SceneStart { scene, source: None, prefix: "/scene" };
    Ok(match (scene, given.has(JobSpec::restart())) {
        (None, false) => {
            let (detail, allowed) = ("a job names a scene or a restart", "an object with a kind");
            errors.push(Violation::new("/scene", "required", detail, Value::Null, allowed));
            own(None)
        }
        (Some(scene), true) => {
            let detail = "a restart takes its scene from the checkpoint; give one of them";
            errors.push(Violation::new("/restart", "conflict", detail, given.raw(JobSpec::restart()), Value::Null));
            own(Some(scene))
        }
        (Some(scene), false) => own(Some(scene)),
        (None, true) => {
            let restart = given.raw(JobSpec::restart());
            if restart.is_null() {
                let allowed = json!({"checkpoint": "ckpt_…"});
                errors.push(Violation::new("/restart", "type", "a restart is an object", Value::Null, allowed));
            }
            let found = match restart.as_object() {
                Some(restart) => restart::scene(Given::new(restart), sources, errors)?,
                None => None,
            };
            let (source, scene) = found.unzip();
            SceneStart { scene, source, prefix: "/restart/overrides" }
        }
    })
}

type PlannedScene = (Option<Box<dyn Scene>>, Vec<String>, CloudSizes);

/// The scene, the uploads that it names, and how many points they have.
fn planned_scene<S: Sources>(
    start: &SceneStart,
    allowance: Allowance,
    sources: &S,
    errors: &mut Vec<Violation>,
) -> Result<PlannedScene, S::Error> {
    let mut refuse = |found: Vec<Violation>| errors.extend(found.into_iter().map(|error| error.under(start.prefix)));
    let scene = start.scene.as_ref().and_then(|value| scene::parse(value, SCENES).map_err(&mut refuse).ok());
    let (mut uploads, mut sizes) = (Vec::new(), CloudSizes::new());
    for cloud in scene.iter().flat_map(|scene| scene.clouds()) {
        match sources::size_of(&cloud, sources, allowance.local_files)? {
            Ok(size) => sizes.extend(size.map(|size| (cloud.pointer, size))),
            Err(violation) => errors.push(violation.under(start.prefix)),
        }
        if let CloudSource::Upload(upload) = cloud.source {
            uploads.push(upload);
        }
    }
    let unfit = scene.iter().flat_map(|scene| scene.check_sizes(&sizes));
    errors.extend(unfit.map(|error| error.under(start.prefix)));
    Ok((scene, uploads, sizes))
}

/// The fields of frames: those given, else all of the scene.
fn field_names(given: Given, scene: Option<&dyn Scene>, errors: &mut Vec<Violation>) -> Vec<String> {
    let known: Vec<&str> =
        scene.map(|scene| scene.fields().iter().map(|field| field.name).collect()).unwrap_or_default();
    let Some(list) = given.read_inside(JobSpec::output(), OutputSpec::fields()).flatten() else {
        return known.iter().map(|name| (*name).to_owned()).collect();
    };
    let mut names = Vec::new();
    for (k, value) in list.0.iter().enumerate() {
        match value.as_str().filter(|name| scene.is_none() || known.contains(name)) {
            Some(name) => names.push(name.to_owned()),
            None if scene.is_some() => {
                let (at, detail) = (format!("/output/fields/{k}"), "the scene has no such field");
                errors.push(Violation::unknown(at, "unknown", detail, value.clone(), value.as_str(), &known));
            }
            None => {}
        }
    }
    names
}

/// An error where operators are asked for and the scene makes none.
fn check_operators(given: Given, scene: &dyn Scene, estimate: &Estimate) -> Option<Violation> {
    let format = given.read_inside(JobSpec::output(), OutputSpec::operators()).flatten()?;
    let detail = "this scene makes no operators that could be written";
    (scene.operator_entries(estimate) == 0.0)
        .then(|| Violation::new("/output/operators", "conflict", detail, format.to_json(), Value::Null))
}

/// What is wrong with the probes and measures for a scene.
fn check_measures(given: Given, scene: &dyn Scene) -> Vec<Violation> {
    let probes = given.read_inside(JobSpec::output(), OutputSpec::probes()).flatten();
    let measures = given.read_inside(JobSpec::output(), OutputSpec::measures()).flatten();
    let (probes, measures) = (probes.unwrap_or_default(), measures.unwrap_or_default());
    OwnMeasures { probes: &probes.0, measures: &measures.0 }.plan(scene).err().unwrap_or_default()
}

/// The limits, with what the service gives where nothing is asked for.
fn limits(given: Given, allowance: Allowance, errors: &mut Vec<Violation>) -> Option<Limits> {
    let mut granted = |asked: Option<u64>, name: &str, most: u64| {
        if let Some(asked) = asked.filter(|asked| *asked > most) {
            let (at, detail) = (format!("/limits/{name}"), "more than this service gives to a job");
            errors.push(Violation::new(at, "range", detail, asked, format!("at most {most}")));
        }
        asked.unwrap_or(most)
    };
    let asked = |key| given.read_inside(JobSpec::limits(), key).flatten();
    let threads = granted(asked(LimitsSpec::threads()), "threads", allowance.threads);
    let memory_bytes = granted(asked(LimitsSpec::memory_bytes()), "memory_bytes", allowance.memory_bytes);
    let whole = given.read(JobSpec::limits()).map(Option::unwrap_or_default);
    let whole = whole.or_else(|| (!given.has(JobSpec::limits())).then(LimitsSpec::default));
    whole.map(|LimitsSpec { wall_s, disk_bytes, .. }| Limits { wall_s, memory_bytes, disk_bytes, threads })
}

/// An error where a scene needs more memory than its limit; an estimate is good within a quarter.
fn check_memory(prefix: &str, scene: &dyn Scene, estimate: &Estimate, limit: u64) -> Option<Violation> {
    let needed = WORKER_BASE_BYTES.saturating_add(estimate.memory_bytes).saturating_mul(5) / 4;
    let detail = format!(
        "about {} particles need {needed} bytes, the limit is {limit} (/limits/memory_bytes); a larger spacing or a narrower \
         band needs less",
        estimate.particles
    );
    let at = format!("{prefix}/spacing");
    (needed > limit).then(|| Violation::new(at, "memory", detail, json!(scene.spacing()), format!("≤ {limit} bytes")))
}

/// An error where the checkpoint lies behind the end of the scene.
fn check_end(source: &RestartSource, estimate: &Estimate) -> Option<Violation> {
    let detail = format!("the checkpoint is at step {}, this scene ends at step {}", source.step, estimate.steps);
    (estimate.steps < source.step)
        .then(|| Violation::new("/restart/overrides", "range", detail, estimate.end_time, Value::Null))
}

fn run_options(spec: &JobSpec, fields: Vec<String>, limits: Limits) -> RunOptions {
    let output = spec.output.clone().unwrap_or_default();
    let checkpoint = Checkpoints::from(spec.checkpoint.clone().unwrap_or_default());
    let OutputSpec { every_time, series_every_steps, operators, probes, measures, .. } = output;
    let (probes, measures) = (Kept(probes.unwrap_or_default()), Kept(measures.unwrap_or_default()));
    RunOptions {
        output: Output { every_time, fields, series_every_steps, probes, measures, operators },
        checkpoint,
        limits,
    }
}

fn forecast(scene: &dyn Scene, estimate: Estimate, options: &RunOptions) -> Forecast {
    Forecast {
        estimate,
        work: scene.work(&estimate, &options.plan()),
        family: scene.family(),
        threads: options.limits.threads,
        memory_bytes: WORKER_BASE_BYTES.saturating_add(estimate.memory_bytes),
        disk_bytes: forecast::disk_bytes(scene, &estimate, options),
        time: None,
    }
}

#[cfg(test)]
mod tests;
