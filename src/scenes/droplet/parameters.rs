//! The JSON of a `droplet` scene.

use super::cases::case;
use crate::scene::schema::{NOT_NEGATIVE, POSITIVE};
use crate::scene::{DefaultValue, Kind, Parameter, Variant};
use crate::scenes::{pcp_parameters, shapes};
use serde::Deserialize;
use serde_json::{Map, Value, json};

const STEPS: Kind = Kind::Integer { least: 1, most: 1_000_000_000 };
const ANYWHERE: Kind = Kind::Vector { positive: false };

pub(super) static PARAMETERS: &[Parameter] = &[
    Parameter::new(
        "case",
        "what starts: an ellipse at rest, a circle that a force tears apart, a circle at rest, or any shape",
        Kind::Word(&["oscillating", "dividing", "static", "custom"]),
        DefaultValue::Json("\"oscillating\""),
    ),
    Parameter::new(
        "dimension",
        "2 or 3; when not given, that of the shape, else 2",
        Kind::Integer { least: 2, most: 3 },
        DefaultValue::Absent,
    ),
    Parameter::new(
        "shape",
        "the drop at the start; by case when not given",
        Kind::Choice(shapes::variants),
        DefaultValue::Absent,
    ),
    Parameter::new(
        "domain",
        "the box, periodic along every axis; by case when not given",
        Kind::Group(&[
            Parameter::new("low", "lower corner", ANYWHERE, DefaultValue::Required),
            Parameter::new("high", "upper corner", ANYWHERE, DefaultValue::Required),
        ]),
        DefaultValue::Absent,
    ),
    Parameter::new("spacing", "h; every side has round(L/h) particles", POSITIVE, DefaultValue::Json("0.03125")),
    Parameter::restart_safe("end_time", "scene time at the end", POSITIVE, DefaultValue::Json("1")),
    Parameter::restart_safe(
        "time_step",
        "Δt, kept whatever the speeds; when neither it nor steps is given, the longest stable one, cut into parts where speeds ask for it",
        POSITIVE,
        DefaultValue::Absent,
    ),
    Parameter::new("steps", "number of equal steps, instead of time_step", STEPS, DefaultValue::Absent),
    Parameter::new(
        "fluids",
        "the fluids inside and outside",
        Kind::Group(&[
            Parameter::new("inside", "the drop", Kind::Group(FLUID), DefaultValue::Json("{}")),
            Parameter::new("outside", "what is round it", Kind::Group(FLUID), DefaultValue::Json("{}")),
        ]),
        DefaultValue::Json("{}"),
    ),
    Parameter::new(
        "surface_tension",
        "τ; by case when not given; with 0 no interface is computed",
        NOT_NEGATIVE,
        DefaultValue::Absent,
    ),
    Parameter::new(
        "tension_force",
        "balanced: −(τ/ρ)(κ − κ₀) n δ with the curvature κ₀ of a ball for each droplet; csf: κ₀ = 0 (the paper)",
        Kind::Word(&["balanced", "csf"]),
        DefaultValue::Json("\"balanced\""),
    ),
    Parameter::new(
        "geometry",
        "where normals and curvatures come from",
        Kind::Choice(|| GEOMETRIES),
        DefaultValue::Json("\"pcp\""),
    ),
    Parameter::new("discretization", "of the flow", Kind::Choice(|| DISCRETIZATIONS), DefaultValue::Json("\"sph\"")),
    Parameter::new(
        "density_method",
        "where densities come from; by case when not given",
        Kind::Choice(|| DENSITIES),
        DefaultValue::Absent,
    ),
    Parameter::new(
        "shifting",
        "particle shifting; by case when not given",
        Kind::Word(&["none", "pst"]),
        DefaultValue::Absent,
    ),
    Parameter::new(
        "body_force",
        "a force from outside; by case when not given",
        Kind::Choice(|| BODY_FORCES),
        DefaultValue::Absent,
    ),
    Parameter::new(
        "integrator",
        "kick_drift_kick: one evaluation a step; predictor_corrector: two (the paper's)",
        Kind::Word(&["kick_drift_kick", "predictor_corrector"]),
        DefaultValue::Json("\"kick_drift_kick\""),
    ),
    Parameter::new("stop_when", "an end before the end time", Kind::Choice(|| STOPS), DefaultValue::Absent),
];

static FLUID: &[Parameter] = &[
    Parameter::new("density", "ρ₀", POSITIVE, DefaultValue::Json("1")),
    Parameter::new("viscosity", "dynamic viscosity η", NOT_NEGATIVE, DefaultValue::Json("0.5")),
    Parameter::new(
        "sound_speed",
        "c, at least ten times the largest speed to come",
        POSITIVE,
        DefaultValue::Json("100"),
    ),
    Parameter::new(
        "polytropic",
        "γ",
        Kind::Number { above: None, least: Some(1.0), below: None, most: Some(20.0) },
        DefaultValue::Json("7"),
    ),
];

/// Closest points with a band.
static PCP: [Parameter; pcp_parameters::PARAMETERS.len() + 1] = {
    let band =
        Parameter::new("band_h", "width of the band in h; 4 ε/h + 1 when not given", POSITIVE, DefaultValue::Absent);
    let mut all = [band; pcp_parameters::PARAMETERS.len() + 1];
    let mut k = 0;
    while k < pcp_parameters::PARAMETERS.len() {
        all[k] = pcp_parameters::PARAMETERS[k];
        k += 1;
    }
    all
};

static GEOMETRIES: &[Variant] = &[
    Variant { name: "pcp", doc: "closest points of a level set that particles carry", parameters: &PCP },
    Variant { name: "colorfield", doc: "the smoothed colour of the phases (eqs. B.5 to B.10)", parameters: &[] },
];

const SMOOTHING: Parameter = Parameter::new(
    "smoothing_h",
    "ε/h; by case when not given",
    Kind::Number { above: None, least: Some(1.0), below: None, most: Some(8.0) },
    DefaultValue::Absent,
);

static DISCRETIZATIONS: &[Variant] = &[
    Variant {
        name: "sph",
        doc: "smoothed particle hydrodynamics",
        parameters: &[
            Parameter::new(
                "kernel",
                "W",
                Kind::Word(&["wendland_c2", "wendland_c4", "cubic_spline", "quintic_spline"]),
                DefaultValue::Json("\"wendland_c2\""),
            ),
            SMOOTHING,
        ],
    },
    Variant {
        name: "dcpse",
        doc: "DC-PSE: fits of polynomials about every particle for pressure gradient and viscosity, densities by continuity",
        parameters: &[
            Parameter::new(
                "order",
                "2 or 4: polynomials of degree 3 or 5",
                Kind::Integer { least: 2, most: 4 },
                DefaultValue::Json("2"),
            ),
            Parameter::new(
                "cutoff_h",
                "r_c/h of the fits; 3.5, of order 4 5.5, when not given; 3 is the paper's, with which particles crowd here",
                Kind::Number { above: None, least: Some(2.0), below: None, most: Some(8.0) },
                DefaultValue::Absent,
            ),
            SMOOTHING,
        ],
    },
];

static DENSITIES: &[Variant] = &[
    Variant { name: "summation", doc: "summation, with pressures in the volume form (eqs. B.1, B.2)", parameters: &[] },
    Variant {
        name: "continuity",
        doc: "continuity with diffusion, and pressures in the mass form (eqs. B.12 to B.14)",
        parameters: &[Parameter::new("diffusion", "ξ̂", NOT_NEGATIVE, DefaultValue::Json("0.05"))],
    },
];

static BODY_FORCES: &[Variant] = &[
    Variant { name: "none", doc: "none", parameters: &[] },
    Variant {
        name: "pulse",
        doc: "along x on the inner fluid: F sin(πt/T) sin(πx/A) cos(πy/2B) (cos(πz/2C)) until T (eqs. 29, 30)",
        parameters: &[
            Parameter::new("coefficient", "F", crate::scene::schema::ANY, DefaultValue::Required),
            Parameter::new("duration", "T", POSITIVE, DefaultValue::Required),
            Parameter::new("A", "half the wave length along x", POSITIVE, DefaultValue::Json("0.5")),
            Parameter::new("B", "a quarter of the wave length along y", POSITIVE, DefaultValue::Json("0.5")),
            Parameter::new("C", "a quarter of the wave length along z", POSITIVE, DefaultValue::Json("0.5")),
        ],
    },
    Variant {
        name: "constant",
        doc: "the same acceleration everywhere",
        parameters: &[Parameter::new("acceleration", "acceleration", ANYWHERE, DefaultValue::Required)],
    },
];

static STOPS: &[Variant] = &[Variant {
    name: "at_rest",
    doc: "nobody has been faster for 50 steps",
    parameters: &[Parameter::new("velocity", "the speed", POSITIVE, DefaultValue::Required)],
}];

/// What section 4.3 and 4.4 state.
pub(super) fn preset(_name: &str, given: &Map<String, Value>) -> Map<String, Value> {
    let name = given.get("case").and_then(Value::as_str).unwrap_or("oscillating");
    let shape_dimension = given.get("shape").and_then(shapes::implied_dimension);
    let dimension = given.get("dimension").and_then(Value::as_u64).map(|d| d as usize).or(shape_dimension).unwrap_or(2);
    let spacing = given.get("spacing").and_then(Value::as_f64).filter(|h| *h > 0.0).unwrap_or(1.0 / 32.0);
    let (degree, cutoff) = case(name, dimension, spacing).fits;
    let mut preset = json!({
        "tension_force": "csf", "integrator": "predictor_corrector",
        "geometry": {
            "type": "pcp", "degree": degree, "basis": "minter", "solver": "orthogonal", "same_branch": false, "weight": 0,
            "minimum_ratio": 1, "sample_threshold_h": 1.5, "tolerance": 1e-12, "max_iterations": 1000
        },
    });
    let own = |name: &str| given.get("geometry").is_some_and(|geometry| geometry.get(name).is_some());
    if !own("neighborhood") && !own("cutoff_h") {
        preset["geometry"]["neighborhood"] = json!({"type": "radius", "cutoff_h": cutoff});
    }
    if !given.contains_key("steps") && !given.contains_key("time_step") && name != "dividing" {
        // 2e-4 at 1/32, 1e-4 at 1/64, 5e-5 at 1/128.
        preset["time_step"] = json!(2e-4 * 32.0 * spacing);
    }
    match preset {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

/// The scene as checked.
#[derive(Debug, Deserialize)]
pub(super) struct Written {
    pub case: String,
    pub dimension: Option<usize>,
    pub shape: Option<Value>,
    pub domain: Option<Corners>,
    pub spacing: f64,
    pub end_time: f64,
    pub time_step: Option<f64>,
    pub steps: Option<u64>,
    pub fluids: Fluids,
    pub surface_tension: Option<f64>,
    pub tension_force: String,
    pub geometry: Value,
    pub discretization: Discretization,
    pub density_method: Option<Density>,
    pub shifting: Option<String>,
    pub body_force: Option<Value>,
    pub integrator: String,
    pub stop_when: Option<Stop>,
}

#[derive(Debug, Clone, Deserialize)]
pub(super) struct Corners {
    pub low: Vec<f64>,
    pub high: Vec<f64>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
pub(super) struct Fluids {
    pub inside: WrittenFluid,
    pub outside: WrittenFluid,
}

#[derive(Debug, Clone, Copy, Deserialize)]
pub(super) struct WrittenFluid {
    pub density: f64,
    pub viscosity: f64,
    pub sound_speed: f64,
    pub polytropic: f64,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Discretization {
    Sph { kernel: String, smoothing_h: Option<f64> },
    Dcpse { order: u64, cutoff_h: Option<f64>, smoothing_h: Option<f64> },
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Density {
    Summation,
    Continuity { diffusion: f64 },
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Stop {
    AtRest { velocity: f64 },
}

#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Force {
    None,
    Pulse {
        coefficient: f64,
        duration: f64,
        #[serde(rename = "A")]
        a: f64,
        #[serde(rename = "B")]
        b: f64,
        #[serde(rename = "C")]
        c: f64,
    },
    Constant {
        acceleration: Vec<f64>,
    },
}
