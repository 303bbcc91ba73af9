//! The JSON of a `vortex` scene.

use crate::scene::schema::POSITIVE;
use crate::scene::{DefaultValue, Kind, Parameter, Variant};
use crate::scenes::flows::{self, Flow, Integrator};
use crate::scenes::{gbpm_parameters, pcp_parameters, shapes};
use serde::Deserialize;
use serde_json::{Map, Value, json};

const STEPS: Kind = Kind::Integer { least: 1, most: 1_000_000_000 };

pub(super) static PARAMETERS: &[Parameter] = &[
    Parameter::new(
        "dimension",
        "2 or 3; when not given, that of the shape, else 2",
        Kind::Integer { least: 2, most: 3 },
        DefaultValue::Absent,
    ),
    Parameter::new(
        "flow",
        "the velocity field",
        Kind::Choice(flows::variants),
        DefaultValue::Json("\"single_vortex\""),
    ),
    Parameter::new(
        "shape",
        "the surface at the start",
        Kind::Choice(shapes::variants),
        DefaultValue::Json(r#"{"type": "circle", "center": [0.5, 0.75], "radius": 0.15}"#),
    ),
    Parameter::new("spacing", "h", POSITIVE, DefaultValue::Json("0.015625")),
    Parameter::new(
        "jitter",
        "α: particles are centres of cells moved by up to α h along every axis",
        Kind::Number { above: None, least: Some(0.0), below: Some(0.5), most: None },
        DefaultValue::Json("0"),
    ),
    Parameter::new(
        "seed",
        "seed of the jitter",
        Kind::Integer { least: 0, most: 9_007_199_254_740_991 },
        DefaultValue::Json("1"),
    ),
    Parameter::restart_safe("end_time", "scene time at the end", POSITIVE, DefaultValue::Json("8")),
    Parameter::new(
        "time_step",
        "Δt; when neither it nor steps is given, end_time/240, and by cfl with gbpm",
        POSITIVE,
        DefaultValue::Absent,
    ),
    Parameter::new("steps", "number of equal steps, instead of time_step", STEPS, DefaultValue::Absent),
    Parameter::new("integrator", "path integrator", Kind::Choice(flows::integrators), DefaultValue::Json("\"rk4\"")),
    Parameter::new("band_h", "width w of the narrow band in h", POSITIVE, DefaultValue::Json("40")),
    Parameter::new(
        "redistance",
        "when to redistance",
        Kind::Choice(redistance_variants),
        DefaultValue::Json("\"auto\""),
    ),
    Parameter::new(
        "field",
        "dual: a transported value that is never touched, distances apart; overwrite: the distance replaces it (the paper)",
        Kind::Word(&["dual", "overwrite"]),
        DefaultValue::Json("\"dual\""),
    ),
    Parameter::new("method", "the method", Kind::Choice(method_variants), DefaultValue::Json("\"auto\"")),
];

static REDISTANCE: &[Variant] = &[
    Variant {
        name: "auto",
        doc: "for_output with a dual field, every second step with an overwritten one",
        parameters: &[],
    },
    Variant {
        name: "every",
        doc: "after every so many steps",
        parameters: &[Parameter::new("steps", "how many", STEPS, DefaultValue::Json("1")), pcp_parameters::CHOSEN],
    },
    Variant {
        name: "for_output",
        doc: "when a frame, an error or the end needs it",
        parameters: &[pcp_parameters::CHOSEN],
    },
];

fn redistance_variants() -> &'static [Variant] {
    REDISTANCE
}

static METHODS: [Variant; 3] = [
    Variant { name: "auto", doc: "the best method measured for the choice of field", parameters: &[] },
    Variant { name: "pcp", doc: "particle closest point", parameters: pcp_parameters::PARAMETERS },
    Variant { name: "gbpm", doc: "grid-based particles, the front itself", parameters: gbpm_parameters::PARAMETERS },
];

fn method_variants() -> &'static [Variant] {
    &METHODS
}

/// What section 4.2 states.
pub(super) fn preset(_name: &str, given: &Map<String, Value>) -> Map<String, Value> {
    if given.get("method").is_some_and(|method| method.get("type").unwrap_or(method) == "gbpm") {
        return front_preset(given);
    }
    let mut method = json!({
        "type": "pcp", "degree": 4, "basis": "minter", "solver": "orthogonal", "same_branch": false, "weight": 0, "minimum_ratio": 1,
        "sample_threshold_h": 1.5, "tolerance": 1e-10, "max_iterations": 100
    });
    let own_neighborhood =
        given.get("method").is_some_and(|m| m.get("neighborhood").is_some() || m.get("cutoff_h").is_some());
    if !own_neighborhood {
        method["neighborhood"] = json!({"type": "radius", "cutoff_h": 15});
    }
    let mut preset = json!({
        "flow": {"type": "single_vortex", "period": 8},
        "shape": {"type": "circle", "center": [0.5, 0.75], "radius": 0.15},
        "end_time": 8, "integrator": "rk4", "band_h": 40, "jitter": 0,
        "redistance": {"type": "every", "steps": 1}, "field": "overwrite", "method": method
    });
    if !given.contains_key("steps") && !given.contains_key("time_step") {
        preset["time_step"] = json!(1.0 / 30.0);
    }
    match preset {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

/// What sections 4.1 to 4.3 and 4.7 of the GBPM paper state.
fn front_preset(given: &Map<String, Value>) -> Map<String, Value> {
    let is_in_space = shapes::is_in_space(given);
    let mut method = Map::new();
    method.insert("type".into(), json!("gbpm"));
    let own = given.get("method").and_then(Value::as_object);
    gbpm_parameters::lay_paper_method(&mut method, own, is_in_space);
    if !["steps", "time_step"].iter().any(|name| given.contains_key(*name)) {
        method.insert("cfl".into(), json!(0.75));
    }
    let mut preset = Map::new();
    preset.insert("integrator".into(), json!("tvd_rk2"));
    preset.insert("method".into(), Value::Object(method));
    preset
}

/// The scene as checked.
#[derive(Debug, Deserialize)]
pub(super) struct Written {
    pub dimension: Option<usize>,
    pub flow: Flow,
    pub shape: Value,
    pub spacing: f64,
    pub jitter: f64,
    pub seed: u64,
    pub end_time: f64,
    pub time_step: Option<f64>,
    pub steps: Option<u64>,
    pub integrator: Integrator,
    pub band_h: f64,
    pub redistance: Redistance,
    pub field: Field,
    pub method: Value,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Redistance {
    Auto,
    Every { steps: u64, chosen: Option<String> },
    ForOutput { chosen: Option<String> },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Field {
    Dual,
    Overwrite,
}
