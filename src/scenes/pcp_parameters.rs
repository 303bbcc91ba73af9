//! The parameters of the closest-point method (`"type": "pcp"`), shared by the scenes that use it.

use crate::closest_point::PcpMethod;
use crate::closest_point::method::NeighborhoodChoice;
use crate::polynomials::Solver;
use crate::polynomials::basis::BasisKind;
use crate::polynomials::multi_index::term_count;
use crate::scene::schema::POSITIVE;
use crate::scene::{DefaultValue, Kind, Parameter, Variant, Violation};
use serde::Deserialize;
use serde_json::{Value, json};

/// Beyond this the outer neighbours weigh nothing and fits starve.
const WEIGHT: Kind = Kind::Number { above: None, least: Some(0.0), below: None, most: Some(50.0) };

/// A resolved scene says in it what `auto` chose, so that the report of a run that starts from it still knows.
pub const CHOSEN: Parameter =
    Parameter::new("chosen", "why this was chosen, where `auto` chose it", Kind::Text, DefaultValue::Absent);

/// Parameters of `pcp`.
pub static PARAMETERS: &[Parameter] = &[
    Parameter::new(
        "degree",
        "total degree of the local polynomials",
        Kind::Integer { least: 1, most: 8 },
        DefaultValue::Json("4"),
    ),
    Parameter::new(
        "basis",
        "basis of the regressions; monomial_unscaled is neither centred nor scaled, for comparison",
        Kind::Word(&["minter", "monomial", "monomial_unscaled"]),
        DefaultValue::Json("\"minter\""),
    ),
    Parameter::new(
        "neighborhood",
        "which particles take part in a fit; radius 2.5 h when not given",
        Kind::Choice(neighborhoods),
        DefaultValue::Absent,
    ),
    Parameter::new("cutoff_h", "short for neighborhood radius {cutoff_h}", POSITIVE, DefaultValue::Absent),
    Parameter::new(
        "same_branch",
        "whether only particles take part in a fit whose last normals agree with that of its centre",
        Kind::Flag,
        DefaultValue::Json("true"),
    ),
    Parameter::new(
        "solver",
        "moments: Gram matrices of scaled monomials, several fits at once, the same polynomial in every basis, with \
         orthogonal where they are too ill-conditioned; orthogonal: QR in the basis, as in the paper",
        Kind::Word(&["moments", "orthogonal"]),
        DefaultValue::Json("\"moments\""),
    ),
    Parameter::new("weight", "k in the weight exp(−k r²/r_c²)", WEIGHT, DefaultValue::Json("2")),
    Parameter::new(
        "minimum_ratio",
        "neighbours per coefficient up to which the radius grows; when not given, 1 where a count of neighbours is given, \
         else 2 for a level that is overwritten and 1.5 for others",
        Kind::Number { above: None, least: Some(1.0), below: None, most: Some(20.0) },
        DefaultValue::Absent,
    ),
    Parameter::new(
        "sample_threshold_h",
        "particles with another of the opposite sign within so many h become sample particles",
        Kind::Number { above: Some(0.5), least: None, below: None, most: Some(10.0) },
        DefaultValue::Json("1.5"),
    ),
    Parameter::new(
        "tolerance",
        "error of a closest point at which iterations end",
        // A looser one would take points off the surface for points of it.
        Kind::Number { above: Some(0.0), least: None, below: None, most: Some(1e-6) },
        DefaultValue::Json("1e-14"),
    ),
    Parameter::new(
        "max_iterations",
        "most iterations of a solve",
        Kind::Integer { least: 1, most: 100_000 },
        DefaultValue::Json("1000"),
    ),
    CHOSEN,
];

static NEIGHBORHOODS: &[Variant] = &[
    Variant {
        name: "radius",
        doc: "all particles within a radius, which grows until there are enough",
        parameters: &[Parameter::new("cutoff_h", "r_c/h", POSITIVE, DefaultValue::Json("2.5"))],
    },
    Variant {
        name: "nearest",
        doc: "the nearest particles",
        parameters: &[Parameter::new(
            "count",
            "how many",
            Kind::Integer { least: 4, most: 10_000 },
            DefaultValue::Json("30"),
        )],
    },
    Variant {
        name: "material",
        doc: "the nearest particles of the initial positions, in which fits are made; for particles that keep their level",
        parameters: &[Parameter::new(
            "count",
            "how many",
            Kind::Integer { least: 4, most: 10_000 },
            DefaultValue::Json("30"),
        )],
    },
];

fn neighborhoods() -> &'static [Variant] {
    NEIGHBORHOODS
}

#[derive(Debug, Deserialize)]
struct Written {
    degree: usize,
    basis: String,
    neighborhood: Option<Neighborhood>,
    cutoff_h: Option<f64>,
    same_branch: bool,
    solver: String,
    weight: f64,
    minimum_ratio: Option<f64>,
    sample_threshold_h: f64,
    tolerance: f64,
    max_iterations: u32,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Neighborhood {
    Radius { cutoff_h: f64 },
    Nearest { count: usize },
    Material { count: usize },
}

/// The method of checked parameters, and the parameters with what was left open.
///
/// # Errors
/// Everything that does not fit together.
pub fn understand(
    written: &Value,
    pointer: &str,
    dimension: usize,
    default_ratio: f64,
) -> Result<(PcpMethod, Value), Vec<Violation>> {
    let parsed: Written = serde_json::from_value(written.clone())
        .map_err(|error| vec![Violation::new(pointer, "type", error.to_string(), written, Value::Null)])?;
    if parsed.neighborhood.is_some() && parsed.cutoff_h.is_some() {
        let detail = "cutoff_h is short for a neighborhood; give one of them";
        let got = json!(parsed.cutoff_h);
        return Err(vec![Violation::new(format!("{pointer}/cutoff_h"), "conflict", detail, &got, Value::Null)]);
    }
    let terms = if dimension == 2 { term_count::<2>(parsed.degree) } else { term_count::<3>(parsed.degree) };
    let neighborhood = match (parsed.neighborhood, parsed.cutoff_h) {
        (Some(Neighborhood::Radius { cutoff_h }), _) | (None, Some(cutoff_h)) => {
            NeighborhoodChoice::Radius { cutoff_h }
        }
        (Some(Neighborhood::Nearest { count }), _) => NeighborhoodChoice::Nearest { count },
        (Some(Neighborhood::Material { count }), _) => NeighborhoodChoice::Material { count },
        (None, None) => NeighborhoodChoice::Radius { cutoff_h: 2.5 },
    };
    if let NeighborhoodChoice::Nearest { count } | NeighborhoodChoice::Material { count } = neighborhood
        && count < terms
    {
        let detail = format!("degree {} has {terms} coefficients", parsed.degree);
        let at = format!("{pointer}/neighborhood/count");
        let allowed = json!(format!("a whole number ≥ {terms}"));
        return Err(vec![Violation::new(at, "range", detail, &json!(count), allowed)]);
    }
    let method = PcpMethod {
        degree: parsed.degree,
        basis: match parsed.basis.as_str() {
            "monomial" => BasisKind::Monomial,
            "monomial_unscaled" => BasisKind::MonomialUnscaled,
            _ => BasisKind::Minter,
        },
        neighborhood,
        solver: if parsed.solver == "orthogonal" { Solver::Orthogonal } else { Solver::Moments },
        // In initial positions branches are apart by themselves.
        same_branch: parsed.same_branch && !matches!(neighborhood, NeighborhoodChoice::Material { .. }),
        weight: parsed.weight,
        minimum_ratio: match neighborhood {
            // A count that is given is meant.
            NeighborhoodChoice::Nearest { .. } | NeighborhoodChoice::Material { .. } => {
                parsed.minimum_ratio.unwrap_or(1.0)
            }
            NeighborhoodChoice::Radius { .. } => parsed.minimum_ratio.unwrap_or(default_ratio),
        },
        sample_threshold_h: parsed.sample_threshold_h,
        tolerance: parsed.tolerance,
        max_iterations: parsed.max_iterations,
    };
    let mut resolved = written.clone();
    resolved["neighborhood"] = match neighborhood {
        NeighborhoodChoice::Radius { cutoff_h } => json!({"type": "radius", "cutoff_h": cutoff_h}),
        NeighborhoodChoice::Nearest { count } => json!({"type": "nearest", "count": count}),
        NeighborhoodChoice::Material { count } => json!({"type": "material", "count": count}),
    };
    resolved["minimum_ratio"] = json!(method.minimum_ratio);
    resolved["same_branch"] = json!(method.same_branch);
    if let Some(map) = resolved.as_object_mut() {
        map.shift_remove("cutoff_h");
    }
    Ok((method, resolved))
}

/// The method with nothing given.
///
/// # Errors
/// As [`understand`].
pub fn defaults(dimension: usize, default_ratio: f64) -> Result<PcpMethod, Violation> {
    let mut violations = Vec::new();
    let checked = crate::scene::check(PARAMETERS, &serde_json::Map::new(), "", &mut violations);
    let understood = understand(&Value::Object(checked), "", dimension, default_ratio);
    understood.map(|(method, _)| method).map_err(|mut found| found.swap_remove(0))
}

/// A violation where fits in material coordinates are asked for particles that do not keep their level.
#[must_use]
pub fn refuse_material(method: &PcpMethod, detail: &str) -> Option<Violation> {
    let NeighborhoodChoice::Material { .. } = method.neighborhood else { return None };
    let (at, allowed) = ("/method/neighborhood/type", json!(["radius", "nearest"]));
    Some(Violation::new(at, "conflict", detail, &json!("material"), allowed))
}
