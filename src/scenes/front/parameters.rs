//! The JSON of a `front` scene.

use crate::scene::schema::{ANY, POSITIVE};
use crate::scene::{DefaultValue, Kind, Parameter, Variant};
use crate::scenes::flows::{self, Flow, Integrator};
use crate::scenes::{gbpm_parameters, shapes};
use serde::Deserialize;
use serde_json::{Map, Value, json};

pub(super) static PARAMETERS: &[Parameter] = &[
    Parameter::new(
        "dimension",
        "2 or 3; when not given, that of the shape, else 2",
        Kind::Integer { least: 2, most: 3 },
        DefaultValue::Absent,
    ),
    Parameter::new("law", "what moves the front", Kind::Choice(laws), DefaultValue::Json("\"normal\"")),
    Parameter::new(
        "shape",
        "the front at the start",
        Kind::Choice(shapes::variants),
        DefaultValue::Json(r#"{"type": "circle", "center": [0.5, 0.5], "radius": 0.25}"#),
    ),
    Parameter::new("spacing", "h of the underlying grid", POSITIVE, DefaultValue::Json("0.0078125")),
    Parameter::restart_safe("end_time", "scene time at the end", POSITIVE, DefaultValue::Json("0.1")),
    Parameter::new("time_step", "Δt, instead of cfl", POSITIVE, DefaultValue::Absent),
    Parameter::new(
        "integrator",
        "integrator of a flow's paths and of motion by curvature; a given speed has straight paths",
        Kind::Choice(flows::integrators),
        DefaultValue::Json("\"rk4\""),
    ),
    gbpm_parameters::DEGREE,
    gbpm_parameters::NEIGHBORS,
    gbpm_parameters::WEIGHT,
    gbpm_parameters::NORMAL_WEIGHT,
    gbpm_parameters::TUBE_RADIUS,
    gbpm_parameters::MIN_SEPARATION,
    gbpm_parameters::SEGMENT_TEST,
    gbpm_parameters::TOPOLOGY,
    gbpm_parameters::ADAPTIVITY,
    gbpm_parameters::CFL,
];

static LAWS: &[Variant] = &[
    Variant {
        name: "normal",
        doc: "a constant speed along the outward normal",
        parameters: &[Parameter::new("speed", "positive outward", ANY, DefaultValue::Json("1"))],
    },
    Variant { name: "mean_curvature", doc: "velocity −κ n", parameters: &[] },
    Variant {
        name: "flow",
        doc: "a prescribed velocity field",
        parameters: &[Parameter::new(
            "flow",
            "the velocity field",
            Kind::Choice(flows::variants),
            DefaultValue::Json("\"single_vortex\""),
        )],
    },
    Variant {
        name: "geometrical_optics",
        doc: "rays that start along the inner normals of a circle or an ellipse, as a curve in (x, y, θ)",
        parameters: &[Parameter::new("speed", "c, everywhere the same", ANY, DefaultValue::Json("1"))],
    },
];

fn laws() -> &'static [Variant] {
    LAWS
}

/// What section 4 states.
pub(super) fn preset(_name: &str, given: &Map<String, Value>) -> Map<String, Value> {
    let mut preset = Map::new();
    let is_in_space = shapes::is_in_space(given);
    gbpm_parameters::lay_paper_method(&mut preset, Some(given), is_in_space);
    preset.insert("integrator".into(), json!("tvd_rk2"));
    let law = given.get("law").map(|law| law.get("type").unwrap_or(law));
    let is_by_curvature = law == Some(&json!("mean_curvature"));
    if is_by_curvature && is_in_space {
        // The paper's ten of a surface blow up with its own step.
        preset.remove("neighbors");
    }
    if !given.contains_key("time_step") && !is_by_curvature {
        preset.insert("cfl".into(), json!(0.75));
    }
    preset
}

/// The scene as checked.
#[derive(Debug, Deserialize)]
pub(super) struct Written {
    pub dimension: Option<usize>,
    pub law: Law,
    pub shape: Value,
    pub spacing: f64,
    pub end_time: f64,
    pub time_step: Option<f64>,
    pub integrator: Integrator,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Law {
    Normal { speed: f64 },
    MeanCurvature,
    Flow { flow: Flow },
    GeometricalOptics { speed: f64 },
}
