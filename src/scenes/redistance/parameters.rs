//! The JSON of a `redistance` scene.

use crate::scene::schema::POSITIVE;
use crate::scene::{DefaultValue, Kind, Parameter, Variant};
use crate::scenes::{pcp_parameters, shapes};
use serde::Deserialize;
use serde_json::{Map, Value, json};

pub(super) static PARAMETERS: &[Parameter] = &[
    Parameter::new(
        "dimension",
        "2 or 3; when not given, that of the shape, else 2",
        Kind::Integer { least: 2, most: 3 },
        DefaultValue::Absent,
    ),
    Parameter::new(
        "shape",
        "the surface; when not given, the ellipse (.75, .5), in 3D the ellipsoid (.75, .5, .5)",
        Kind::Choice(shapes::variants),
        DefaultValue::Absent,
    ),
    Parameter::new("spacing", "h", POSITIVE, DefaultValue::Json("0.015625")),
    Parameter::new(
        "jitter",
        "α: particles are multiples of h moved by up to α h along every axis",
        Kind::Number { above: None, least: Some(0.0), below: Some(0.5), most: None },
        DefaultValue::Json("0.3"),
    ),
    Parameter::new(
        "seed",
        "seed of the jitter",
        Kind::Integer { least: 0, most: 9_007_199_254_740_991 },
        DefaultValue::Json("1"),
    ),
    Parameter::new(
        "initial",
        "level-set function at the start; quadric for ellipses and ellipsoids, else distance, when not given",
        Kind::Choice(initial_variants),
        DefaultValue::Absent,
    ),
    Parameter::new(
        "band_h",
        "width w of the narrow band in h; 12 when neither it nor band is given",
        POSITIVE,
        DefaultValue::Absent,
    ),
    Parameter::new("band", "width w of the narrow band", POSITIVE, DefaultValue::Absent),
    Parameter::restart_safe(
        "repeat",
        "redistancings in a row",
        Kind::Integer { least: 1, most: 1_000_000 },
        DefaultValue::Json("1"),
    ),
    Parameter::new("method", "the method", Kind::Choice(method_variants), DefaultValue::Json("\"pcp\"")),
    Parameter::new(
        "queries",
        "where to ask for the distance; with points of a file frames show those",
        Kind::Choice(query_variants),
        DefaultValue::Json("\"particles\""),
    ),
];

static QUERIES: [Variant; 2] =
    [Variant { name: "particles", doc: "the particles themselves", parameters: &[] }, shapes::POINTS];

fn query_variants() -> &'static [Variant] {
    &QUERIES
}

static INITIAL: &[Variant] = &[
    Variant { name: "quadric", doc: "√(Σ x²/A²) − 1 of an ellipse or ellipsoid", parameters: &[] },
    Variant { name: "distance", doc: "the exact distance", parameters: &[] },
    Variant { name: "scaled", doc: "the exact distance times 1 + 0.5 x + 0.3 y", parameters: &[] },
];

fn initial_variants() -> &'static [Variant] {
    INITIAL
}

static METHODS: [Variant; 2] = [
    Variant { name: "pcp", doc: "particle closest point", parameters: pcp_parameters::PARAMETERS },
    Variant {
        name: "remesh",
        doc: "the baseline: interpolation to a grid, then closest points on it by Taylor polynomials of degree 4",
        parameters: &[Parameter::new(
            "kernel",
            "how values get to the nodes",
            Kind::Choice(kernel_variants),
            DefaultValue::Json("\"lambda44_normalized\""),
        )],
    },
];

const SMOOTHING: &[Parameter] = &[Parameter::new(
    "smoothing_h",
    "ε/h; 1.5 (1/(16 h))^0.35 when not given: it must grow as h falls",
    POSITIVE,
    DefaultValue::Absent,
)];

static KERNELS: &[Variant] = &[
    Variant { name: "lambda44", doc: "Λ₄,₄, plain sums", parameters: &[] },
    Variant { name: "lambda44_normalized", doc: "Λ₄,₄, divided by the sum of weights", parameters: &[] },
    Variant { name: "wendland_c2", doc: "Wendland C², weighted by volumes and normalised", parameters: SMOOTHING },
    Variant { name: "gaussian", doc: "Gaussian, weighted by volumes and normalised", parameters: SMOOTHING },
];

fn kernel_variants() -> &'static [Variant] {
    KERNELS
}

fn method_variants() -> &'static [Variant] {
    &METHODS
}

/// What section 4.1 states: unweighted fits, r_c = 2.5 h in 2D; 2.4 h (degree 5: 2.6 h) in 3D.
pub(super) fn preset(_name: &str, given: &Map<String, Value>) -> Map<String, Value> {
    let shape_dimension = given.get("shape").and_then(shapes::implied_dimension);
    let named = given.get("dimension").and_then(Value::as_u64).map(|d| d as usize);
    let solid = named.or(shape_dimension) == Some(3);
    let degree = given.get("method").and_then(|m| m.get("degree")).and_then(Value::as_u64).unwrap_or(4);
    let cutoff = match (solid, degree) {
        (false, _) => 2.5,
        (true, 5) => 2.6,
        (true, _) => 2.4,
    };
    let method = json!({
        "type": "pcp", "degree": 4, "basis": "minter", "solver": "orthogonal", "same_branch": false, "weight": 0, "minimum_ratio": 1,
        "sample_threshold_h": 1.5, "tolerance": 1e-14, "max_iterations": 1000
    });
    let mut preset = Map::from_iter([("jitter".to_owned(), json!(0.3)), ("method".to_owned(), method)]);
    let own_neighborhood =
        given.get("method").is_some_and(|m| m.get("neighborhood").is_some() || m.get("cutoff_h").is_some());
    if !own_neighborhood {
        preset["method"]["neighborhood"] = json!({"type": "radius", "cutoff_h": cutoff});
    }
    if solid && !given.contains_key("band") {
        preset.insert("band_h".into(), json!(12));
    }
    preset
}

/// The scene as checked.
#[derive(Debug, Deserialize)]
pub(super) struct Written {
    pub dimension: Option<usize>,
    pub shape: Option<Value>,
    pub spacing: f64,
    pub jitter: f64,
    pub seed: u64,
    pub initial: Option<Value>,
    pub band_h: Option<f64>,
    pub band: Option<f64>,
    pub repeat: u64,
    pub method: Value,
    pub queries: Value,
}
