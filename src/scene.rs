//! Scenes: from parameters as written to a valid scene that builds a simulation.
//!
//! A scene kind declares its parameters as data ([`schema::Parameter`]); checking, defaults, presets, JSON Schema and
//! the list of restart-safe fields all come from that declaration.

pub mod check;
pub mod cloud;
pub mod json_schema;
pub mod schema;
pub mod work;

pub use check::{Violation, check};
pub use cloud::{Cloud, CloudReference, CloudSizes, CloudSource, Clouds};
pub use schema::{Default as DefaultValue, Kind, Parameter, Variant};
pub use work::PhaseWork;

use crate::parallel::Interrupt;
use crate::simulation::{CpuClock, OutputPlan, Simulation};
use serde_json::{Map, Value};

/// A kind of scene: everything that clients learn of it, and how its JSON becomes a scene.
pub struct SceneKind {
    /// The `kind` in JSON.
    pub kind: &'static str,
    /// One line.
    pub title: &'static str,
    /// Its parameters, `kind` and `preset` excepted.
    pub parameters: &'static [Parameter],
    /// Names of presets.
    pub presets: &'static [&'static str],
    /// Parameters of a preset, given what else stands in the scene.
    pub preset: fn(name: &str, given: &Map<String, Value>) -> Map<String, Value>,
    /// A small job body that runs in seconds.
    pub example: &'static str,
    /// Short scenes by which the speed of a machine is measured, as a JSON array. Together they have every phase of the kind.
    pub calibration: &'static str,
    /// From checked parameters (all defaults present) to a scene.
    pub understand: fn(parameters: &Value) -> Understood,
}

/// A scene, or all that is wrong with its parameters.
pub type Understood = Result<Box<dyn Scene>, Vec<Violation>>;

/// A valid scene.
pub trait Scene: Send + Sync {
    /// The parameters with every default and every automatic choice that is known before a run.
    fn resolved(&self) -> Value;

    /// Fields that frames can show.
    fn field_names(&self) -> Vec<&'static str>;

    /// Points from outside that the scene needs to be built.
    fn clouds(&self) -> Vec<CloudReference> {
        Vec::new()
    }

    /// Size of the run; `sizes` tells of points that come from outside.
    fn estimate(&self, sizes: &CloudSizes) -> Estimate;

    /// Runs of one family cost about the same for a unit of work: kind, dimension, and what the method makes of them.
    fn family(&self) -> String;

    /// Work of the run by phase, for its size and a plan of output.
    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork>;

    /// The simulation at its start. Memory for particles is allocated here.
    ///
    /// # Errors
    /// What turns out not to fit together only when it is made; a checked scene has nothing of that left.
    fn build(&self, context: BuildContext) -> Result<Box<dyn Simulation>, Vec<Violation>>;
}

/// What a scene is told when it is built.
#[derive(Debug, Clone)]
pub struct BuildContext {
    /// When output is wanted.
    pub plan: OutputPlan,
    /// Asks a running step to be dropped.
    pub interrupt: Interrupt,
    /// Counter of CPU seconds.
    pub cpu_clock: CpuClock,
    /// Points from outside, as [`Scene::clouds`] names them.
    pub clouds: Clouds,
}

/// The size of a run, before it is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Particles, within a few per cent.
    pub particles: u64,
    /// Steps.
    pub steps: u64,
    /// Δt.
    pub time_step: f64,
    /// Scene time at the end.
    pub end_time: f64,
    /// Resident memory of the simulation itself.
    pub memory_bytes: u64,
}

/// From the JSON of a scene (`{"kind": …, …}`) to a scene. Pointers of violations start at the scene.
///
/// 1. The kind is looked up. 2. The preset is laid under what is given. 3. Parameters are checked one by one,
///    defaults filled in. 4. The kind checks what parameters mean together.
///
/// # Errors
/// All violations at once.
pub fn understand(value: &Value, kinds: &[&'static SceneKind]) -> Understood {
    let Value::Object(given) = value else {
        return Err(vec![Violation::new("", "type", "a scene is an object", value, "an object with a kind".into())]);
    };
    let names: Vec<&str> = kinds.iter().map(|kind| kind.kind).collect();
    let Some(kind) = given.get("kind") else {
        let detail = "every scene names its kind";
        return Err(vec![Violation::new("/kind", "required", detail, &Value::Null, names.into())]);
    };
    let Some(scene_kind) = kind.as_str().and_then(|name| kinds.iter().find(|k| k.kind == name)) else {
        let mut violation =
            Violation::new("/kind", "unknown", "there is no such kind of scene", kind, names.clone().into());
        violation.did_you_mean = kind.as_str().and_then(|name| check::closest(name, &names));
        return Err(vec![violation]);
    };
    let mut violations = Vec::new();
    let mut given = given.clone();
    given.shift_remove("kind");
    if let Some(preset) = given.shift_remove("preset") {
        match preset.as_str().filter(|name| scene_kind.presets.contains(name)) {
            Some(name) => given = check::laid_under((scene_kind.preset)(name, &given), given),
            None => {
                let allowed = scene_kind.presets.to_vec();
                let mut violation =
                    Violation::new("/preset", "unknown", "there is no such preset", &preset, allowed.into());
                violation.did_you_mean = preset.as_str().and_then(|name| check::closest(name, scene_kind.presets));
                violations.push(violation);
            }
        }
    }
    let mut resolved = check(scene_kind.parameters, &given, "", &mut violations);
    // A name near `preset` is a likely slip, but `check` knows parameters only.
    for violation in &mut violations {
        if violation.code == "unknown_field" && violation.did_you_mean.is_none() {
            let name = violation.pointer.trim_start_matches('/').to_owned();
            violation.did_you_mean = check::closest(&name, &["preset", "kind"]);
        }
    }
    if !violations.is_empty() {
        return Err(violations);
    }
    let mut whole = Map::new();
    whole.insert("kind".into(), scene_kind.kind.into());
    whole.append(&mut resolved);
    (scene_kind.understand)(&Value::Object(whole))
}
