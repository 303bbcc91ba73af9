//! Scenes: from declared parameters to a valid scene that builds a simulation.
//!
//! A kind of scene declares its parameters once ([`crate::spec`]). What they mean together is its plan: the step from its
//! spec to a [`Scene`], which returns everything that is wrong.

pub mod cloud;
pub mod mesh;
pub mod view;
pub mod work;

pub use cloud::{Cloud, CloudReference, CloudRole, CloudSize, CloudSizes, CloudSource, Clouds, Column};
pub use mesh::{MeshSize, mesh_size};
pub use view::View;
pub use work::PhaseWork;

use crate::parallel::Interrupt;
use crate::simulation::{CpuClock, Finding, OutputPlan, Quantity, Region, Simulation};
use crate::spec::{Declaration, Given, Group, Json, Object, Preset, Violation, group, suggest};
use serde_json::json;

/// The declared parameters of a kind of scene, and their meaning together.
pub trait SceneSpec: Group {
    /// From parameters that are valid one by one to a scene.
    ///
    /// # Errors
    /// Everything that does not fit together.
    fn plan(self) -> Planned;
}

/// A scene, or everything that is wrong with its parameters.
pub type Planned = Result<Box<dyn Scene>, Vec<Violation>>;

/// A named preset: values that a name stands for, depending on what else is given.
pub type NamedPreset = (&'static str, fn(Given) -> Preset);

/// A kind of scene: everything that clients learn of it, and how its JSON becomes a scene.
pub struct SceneKind {
    /// The `kind` in JSON.
    pub kind: &'static str,
    /// What it simulates, in one line.
    pub title: &'static str,
    /// Presets by name.
    pub presets: &'static [NamedPreset],
    /// A small job body that runs in seconds.
    pub example: &'static str,
    /// Short scenes by which the speed of a machine is measured, as a JSON array. Together they have every phase of the kind.
    pub calibration: &'static str,
    /// Short scenes with spacings, as a JSON array: what they say of errors tells where the search for an accuracy begins.
    pub precision: &'static str,
    /// What a resolved scene of an earlier version sets otherwise, so that it means the same now.
    pub of_earlier_version: fn(Given) -> Preset,
    /// What frames, series and reports of the kind show.
    pub quantities: fn() -> Quantities,
    /// Its parameters, `kind` and `preset` excepted.
    pub declarations: fn() -> Vec<Declaration>,
    /// From its parameters as sent, and what is already known to be wrong, to a scene.
    pub parse: fn(given: &Object, errors: Vec<Violation>) -> Planned,
}

/// Nothing: resolved scenes of every earlier version mean the same now.
#[must_use]
pub fn unchanged(_: Given) -> Preset {
    Preset::default()
}

/// A resolved scene as this version writes it: scenes of earlier versions go on to mean what they meant.
#[must_use]
pub fn of_earlier_version(scene: Json, kinds: &[&'static SceneKind]) -> Json {
    let Json::Object(given) = scene else { return scene };
    match find_kind(&given, kinds) {
        Ok(kind) => {
            let preset = (kind.of_earlier_version)(Given::new(&given));
            Json::Object(preset.over(given))
        }
        Err(_) => Json::Object(given),
    }
}

/// The quantities that the schemes of a kind declare.
#[derive(Debug, Clone)]
pub struct Quantities {
    /// Fields of frames.
    pub fields: Vec<&'static Quantity>,
    /// Scalars of the series.
    pub observables: Vec<&'static Quantity>,
    /// Norms of the errors in reports.
    pub norms: Vec<&'static Quantity>,
}

/// Parses the parameters of a kind and plans its scene: the `parse` of a [`SceneKind`].
///
/// # Errors
/// Everything that is wrong with single parameters, or else with what they mean together.
pub fn parse_as<S: SceneSpec>(given: &Object, mut errors: Vec<Violation>) -> Planned {
    let names = S::names();
    group::check_names(given, &names, "", &mut errors);
    let spec = S::parse_fields(given, "", &mut errors);
    match spec.filter(|_| errors.is_empty()) {
        Some(spec) => spec.plan(),
        None => Err(errors),
    }
}

/// The resolved parameters of a scene: every field of its spec, and its kind.
#[must_use]
pub fn resolved(kind: &str, spec: &impl Group) -> Json {
    let mut object = Object::from_iter([("kind".to_owned(), kind.into())]);
    spec.write_fields(&mut object);
    Json::Object(object)
}

impl SceneKind {
    /// The JSON Schema of the kind: defaults, ranges, and `x-restart-safe` on what a restart may change.
    #[must_use]
    pub fn json_schema(&self) -> Json {
        let mut schema = group::schema(&(self.declarations)());
        if let Some(Json::Object(properties)) = schema.get_mut("properties") {
            properties.shift_insert(0, "kind".into(), json!({"const": self.kind}));
            if !self.presets.is_empty() {
                let description = "sets every parameter that the paper states; anything given beside it wins";
                let preset = json!({"enum": self.preset_names(), "description": description});
                properties.shift_insert(1, "preset".into(), preset);
            }
        }
        if let Some(Json::Array(required)) = schema.get_mut("required") {
            required.insert(0, json!("kind"));
        }
        let mut whole = Object::new();
        whole.insert("$schema".into(), json!("https://json-schema.org/draft/2020-12/schema"));
        whole.insert("title".into(), json!(self.title));
        whole.append(&mut schema);
        Json::Object(whole)
    }

    /// Names of the presets.
    #[must_use]
    pub fn preset_names(&self) -> Vec<&'static str> {
        self.presets.iter().map(|(name, _)| *name).collect()
    }

    /// Pointers to the fields that a restart may change.
    #[must_use]
    pub fn restart_safe(&self) -> Vec<String> {
        (self.declarations)().iter().filter(|d| d.is_restart_safe).map(|d| format!("/{}", d.name)).collect()
    }
}

/// A valid scene.
pub trait Scene: Send + Sync {
    /// Name of the kind of scene.
    fn kind(&self) -> &'static str;

    /// Dimension of the space: 2 or 3.
    fn dimension(&self) -> usize;

    /// Distance of neighboring particles or points, where it is known before a run.
    fn spacing(&self) -> Option<f64>;

    /// The length that errors of the scene go by: half the least extent of its shape, where that is known.
    fn size(&self) -> Option<f64> {
        None
    }

    /// Order p of an error ~ spacingᵖ that theory gives, by quantity and norm of the report; None where none is known.
    fn order(&self, _quantity: &str, _norm: &str) -> Option<f64> {
        None
    }

    /// Fields that decide between speed and accuracy, by JSON pointer, with the values that are worth a comparison. Where a body
    /// leaves one open and asks for an accuracy, the cheapest value is found by runs.
    fn choices(&self) -> Vec<(&'static str, Vec<Json>)> {
        Vec::new()
    }

    /// The parameters with every default and every automatic choice that is known before a run.
    fn resolved(&self) -> Json;

    /// Fields that frames can show, as the scheme declares them.
    fn fields(&self) -> Vec<&'static Quantity>;

    /// What pictures of its frames show.
    fn view(&self) -> View;

    /// Entries of all operators together that a run can write, about; zero where a scene makes none.
    fn operator_entries(&self, _estimate: &Estimate) -> f64 {
        0.0
    }

    /// Regions that integrals can be taken over.
    fn regions(&self) -> Vec<Region> {
        Vec::new()
    }

    /// Points from outside that the scene needs to be built.
    fn clouds(&self) -> Vec<CloudReference> {
        Vec::new()
    }

    /// What does not fit together of the things that come from outside, as far as their sizes tell.
    fn check_sizes(&self, _sizes: &CloudSizes) -> Vec<Violation> {
        Vec::new()
    }

    /// Size of the run; `sizes` tells of points that come from outside.
    fn estimate(&self, sizes: &CloudSizes) -> Estimate;

    /// What is doubtful about the scene before it runs.
    fn warnings(&self) -> Vec<Finding> {
        Vec::new()
    }

    /// Dimensionless numbers of the scene by their names; empty where it has none.
    fn numbers(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }

    /// Runs of one family cost about the same for a unit of work: kind, dimension, and what the method makes of them.
    fn family(&self) -> String;

    /// Work of the run by phase, for its size and a plan of output.
    fn work(&self, estimate: &Estimate, plan: &OutputPlan) -> Vec<PhaseWork>;

    /// The simulation at its start. Memory for particles is allocated here.
    ///
    /// # Errors
    /// What turns out not to fit together only when it is made, with points from outside above all.
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
    /// Number of particles, within a few per cent.
    pub particles: u64,
    /// Number of steps.
    pub steps: u64,
    /// Time step Δt.
    pub time_step: f64,
    /// Scene time at the end.
    pub end_time: f64,
    /// Resident memory of the simulation itself, in bytes.
    pub memory_bytes: u64,
}

/// From the JSON of a scene (`{"kind": …, …}`) to a scene. Pointers of errors begin at the scene.
///
/// 1. The kind is looked up. 2. The preset is laid under what is given. 3. Parameters are read one by one, defaults filled in.
/// 4. The kind checks what parameters mean together.
///
/// # Errors
/// All of them at once.
pub fn parse(value: &Json, kinds: &[&'static SceneKind]) -> Planned {
    let Json::Object(given) = value else {
        let allowed = "an object with a kind";
        return Err(vec![Violation::new("", "type", "a scene is an object", value.clone(), allowed)]);
    };
    let kind = find_kind(given, kinds).map_err(|error| vec![error])?;
    let mut given = given.clone();
    given.shift_remove("kind");
    let mut errors = Vec::new();
    if let Some(name) = given.shift_remove("preset") {
        let known = kind.presets.iter().find(|(known, _)| name == *known);
        match known {
            Some((_, preset)) => given = preset(Given::new(&given)).under(given),
            None => {
                let names = kind.preset_names();
                let detail = "there is no such preset";
                errors.push(Violation::unknown("/preset", "unknown", detail, name.clone(), name.as_str(), &names));
            }
        }
    }
    (kind.parse)(&given, errors).map_err(|errors| errors.into_iter().map(suggest_own_names).collect())
}

fn find_kind(given: &Object, kinds: &[&'static SceneKind]) -> Result<&'static SceneKind, Violation> {
    let names: Vec<&str> = kinds.iter().map(|kind| kind.kind).collect();
    let Some(kind) = given.get("kind") else {
        return Err(Violation::new("/kind", "required", "every scene names its kind", Json::Null, names));
    };
    kinds.iter().copied().find(|known| *kind == known.kind).ok_or_else(|| {
        Violation::unknown("/kind", "unknown", "there is no such kind of scene", kind.clone(), kind.as_str(), &names)
    })
}

/// A name near `preset` or `kind` is a likely slip, but the spec of a kind knows its parameters only.
fn suggest_own_names(mut error: Violation) -> Violation {
    if error.code == "unknown_field" && error.did_you_mean.is_none() {
        error.did_you_mean = suggest(error.pointer.trim_start_matches('/'), &["preset", "kind"]);
    }
    error
}
