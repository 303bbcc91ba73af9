//! The JSON of a `surface_pde` scene.

use crate::scene::schema::POSITIVE;
use crate::scene::{DefaultValue, Kind, Parameter, Variant};
use serde::Deserialize;
use serde_json::{Map, Value};

pub(super) static PARAMETERS: &[Parameter] = &[
    Parameter::new(
        "surface",
        "the surface, about the origin",
        Kind::Choice(|| SURFACES),
        DefaultValue::Json("\"sphere\""),
    ),
    Parameter::new(
        "count",
        "number of points, spread as Fibonacci points of the sphere",
        Kind::Integer { least: 100, most: 100_000_000 },
        DefaultValue::Json("4000"),
    ),
    Parameter::new(
        "problem",
        "what is computed",
        Kind::Choice(|| PROBLEMS),
        DefaultValue::Json("\"laplace_beltrami\""),
    ),
    Parameter::new("method", "the method", Kind::Choice(|| METHODS), DefaultValue::Json("\"surface_dcpse\"")),
    Parameter::restart_safe(
        "repeat",
        "applications of the operator in a row, one a step",
        Kind::Integer { least: 1, most: 1_000_000 },
        DefaultValue::Json("1"),
    ),
];

static SURFACES: &[Variant] = &[
    Variant {
        name: "sphere",
        doc: "a sphere",
        parameters: &[Parameter::new("radius", "R", POSITIVE, DefaultValue::Json("1"))],
    },
    Variant {
        name: "ellipsoid",
        doc: "an ellipsoid; its points are those of the unit sphere, stretched",
        parameters: &[Parameter::new(
            "semi_axes",
            "along x, y and z",
            Kind::Vector { positive: true },
            DefaultValue::Json("[1, 0.8, 0.75]"),
        )],
    },
];

static PROBLEMS: &[Variant] = &[Variant {
    name: "laplace_beltrami",
    doc: "Δₛ of a field: `value` against `reference`",
    parameters: &[Parameter::new(
        "field",
        "the field",
        Kind::Choice(|| FIELDS),
        DefaultValue::Json("\"spherical_harmonic\""),
    )],
}];

static FIELDS: &[Variant] = &[
    Variant {
        name: "spherical_harmonic",
        doc: "real orthonormal Y_lm, on a sphere: m > 0 ∝ cos mφ, m < 0 ∝ sin |m|φ",
        parameters: &[
            Parameter::new("l", "degree", Kind::Integer { least: 1, most: 64 }, DefaultValue::Json("4")),
            Parameter::new(
                "m",
                "order, a whole number from −l to l",
                Kind::Number { above: None, least: Some(-64.0), below: None, most: Some(64.0) },
                DefaultValue::Json("0"),
            ),
        ],
    },
    Variant {
        name: "plane_wave",
        doc: "sin(k·x), on any surface",
        parameters: &[Parameter::new("k", "k", Kind::Vector { positive: false }, DefaultValue::Json("[2, -1, 3]"))],
    },
];

static METHODS: &[Variant] = &[Variant {
    name: "surface_dcpse",
    doc: "Surface DC-PSE in its intrinsic form: fits of polynomials on the tangent plane of each point",
    parameters: &[
        Parameter::new(
            "order",
            "2, 4 or 6: polynomials of degree 3, 5 or 7",
            Kind::Integer { least: 2, most: 6 },
            DefaultValue::Json("2"),
        ),
        Parameter::new(
            "cutoff_dn",
            "r_c by δn = √(area/N); 2.4, 3.3, 4.2 for orders 2, 4, 6 when not given",
            Kind::Number { above: Some(1.0), least: None, below: None, most: Some(20.0) },
            DefaultValue::Absent,
        ),
    ],
}];

/// There are none.
pub(super) fn preset(_name: &str, _given: &Map<String, Value>) -> Map<String, Value> {
    Map::new()
}

/// The scene as checked.
#[derive(Debug, Deserialize)]
pub(super) struct Written {
    pub surface: Value,
    pub count: u64,
    pub problem: WrittenProblem,
    pub method: WrittenMethod,
    pub repeat: u64,
}

#[derive(Debug, Deserialize)]
pub(super) struct WrittenProblem {
    pub field: Value,
}

#[derive(Debug, Deserialize)]
pub(super) struct WrittenMethod {
    pub order: u64,
    pub cutoff_dn: Option<f64>,
}
