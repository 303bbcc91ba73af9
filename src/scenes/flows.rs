//! Velocity fields and path integrators as parameters, shared by the scenes of moving fronts.

use crate::geometry::flows::{Rotation, SingleVortex, Translation, Vortex3d};
use crate::geometry::{self, Vector};
use crate::scene::schema::{ANY, POSITIVE};
use crate::scene::{DefaultValue, Kind, Parameter, Variant, Violation};
use crate::scenes::dimension::in_dimension;
use crate::time::PathIntegrator;
use serde::Deserialize;
use serde_json::json;

/// Below round-off no tolerance can be kept.
const TOLERANCE: Kind = Kind::Number { above: None, least: Some(1e-15), below: None, most: Some(1.0) };

static FLOWS: &[Variant] = &[
    Variant {
        name: "single_vortex",
        doc: "the spiraling vortex in the unit square (2D)",
        parameters: &[Parameter::new(
            "period",
            "T of the reversal; null never turns; 8 when not given",
            POSITIVE,
            DefaultValue::JsonOrNull("8"),
        )],
    },
    Variant {
        name: "vortex_3d",
        doc: "the deforming flow in the unit cube (3D)",
        parameters: &[Parameter::new(
            "period",
            "T of the reversal; null never turns; 2 when not given",
            POSITIVE,
            DefaultValue::JsonOrNull("2"),
        )],
    },
    Variant {
        name: "rotation",
        doc: "rigid rotation about a point in the x–y plane",
        parameters: &[
            Parameter::new("center", "fixed point", Kind::Vector { positive: false }, DefaultValue::Required),
            Parameter::new("angular_velocity", "counter-clockwise", ANY, DefaultValue::Required),
        ],
    },
    Variant {
        name: "translation",
        doc: "uniform motion",
        parameters: &[Parameter::new("velocity", "velocity", Kind::Vector { positive: false }, DefaultValue::Required)],
    },
];

/// The variants of `flow`.
#[must_use]
pub fn variants() -> &'static [Variant] {
    FLOWS
}

static INTEGRATORS: &[Variant] = &[
    Variant { name: "rk4", doc: "classical Runge–Kutta of order 4", parameters: &[] },
    Variant { name: "tvd_rk2", doc: "TVD Runge–Kutta of order 2", parameters: &[] },
    Variant {
        name: "dopri5",
        doc: "Dormand–Prince 5(4) with error control inside each step",
        parameters: &[Parameter::new("tolerance", "error of an inner step", TOLERANCE, DefaultValue::Json("1e-9"))],
    },
];

/// The variants of `integrator`.
#[must_use]
pub fn integrators() -> &'static [Variant] {
    INTEGRATORS
}

/// A checked flow.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Flow {
    SingleVortex {
        period: Option<f64>,
    },
    #[serde(rename = "vortex_3d")]
    Vortex3d {
        period: Option<f64>,
    },
    Rotation {
        center: Vec<f64>,
        angular_velocity: f64,
    },
    Translation {
        velocity: Vec<f64>,
    },
}

/// A checked integrator.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Integrator {
    Rk4,
    TvdRk2,
    Dopri5 { tolerance: f64 },
}

impl Integrator {
    /// The integrator.
    #[must_use]
    pub fn path(self) -> PathIntegrator {
        match self {
            Self::Rk4 => PathIntegrator::Rk4,
            Self::TvdRk2 => PathIntegrator::TvdRk2,
            Self::Dopri5 { tolerance } => PathIntegrator::Dopri5 { tolerance },
        }
    }
}

/// The velocity field of a checked flow.
///
/// # Errors
/// Where it does not exist in this dimension.
pub fn flow<const D: usize>(flow: &Flow) -> Result<Box<dyn geometry::Flow<D>>, Violation> {
    let vector = |name: &str, numbers: &[f64]| {
        if numbers.len() == D {
            return Ok(Vector::<D>::from_column_slice(numbers));
        }
        let detail = format!("the scene has {D} dimensions");
        Err(Violation::new(format!("/flow/{name}"), "conflict", detail, &json!(numbers), json!(format!("{D} numbers"))))
    };
    let elsewhere = |name: &str, place: &str| {
        let detail = format!("{name} lives in {place}, the scene has {D} dimensions");
        let here = if D == 2 { "single_vortex" } else { "vortex_3d" };
        Violation::new("/flow/type", "conflict", detail, &json!(name), json!([here, "rotation", "translation"]))
    };
    match flow {
        Flow::SingleVortex { period } => {
            let vortex: Box<dyn geometry::Flow<2>> = Box::new(SingleVortex { period: *period });
            in_dimension(vortex).ok_or_else(|| elsewhere("single_vortex", "plane"))
        }
        Flow::Vortex3d { period } => {
            let vortex: Box<dyn geometry::Flow<3>> = Box::new(Vortex3d { period: *period });
            in_dimension(vortex).ok_or_else(|| elsewhere("vortex_3d", "space"))
        }
        Flow::Rotation { center, angular_velocity } => {
            Ok(Box::new(Rotation { center: vector("center", center)?, angular_velocity: *angular_velocity }))
        }
        Flow::Translation { velocity } => Ok(Box::new(Translation { velocity: vector("velocity", velocity)? })),
    }
}
