//! The parameters of the grid-based particle method, shared by `front` and by `vortex` with `method: "gbpm"`.

use crate::scene::schema::POSITIVE;
use crate::scene::{DefaultValue, Kind, Parameter, Variant, Violation};
use crate::scenes::curvature_stability::{fewest_particles, most_weight};
use crate::schemes::grid_based_particle::{self as gbpm, FrontMethod, MOST_LEVELS, Segments, Topology};
use serde::Deserialize;
use serde_json::{Map, Value, json};

/// Degree of the reconstructions.
pub const DEGREE: Parameter = Parameter::new(
    "degree",
    "degree of the local reconstructions; when not given, 4 in the plane and under mean_curvature, 2 in space else",
    Kind::Integer { least: 2, most: 4 },
    DefaultValue::Absent,
);
/// Particles of a reconstruction.
pub const NEIGHBORS: Parameter = Parameter::new(
    "neighbors",
    "particles of a reconstruction; when not given, in the plane 6, 7, 8 of degree 2, 3, 4; in space as many as coefficients where normals weigh \
     .1 or more, else 16, of degree 4 24; under mean_curvature of degree 4 10 in the plane, 36 in space, \
     and in sharp bends the nearest 6 (16) of them and degree 2; fewer where fewer are in reach",
    Kind::Integer { least: 3, most: 60 },
    DefaultValue::Absent,
);
/// Weight.
pub const WEIGHT: Parameter = Parameter::new(
    "weight",
    "k in the weights exp(−k t²), t the distance along the front in h; when not given, 1 for degree 4 in the plane, 0 else and under mean_curvature",
    Kind::Number { above: None, least: Some(0.0), below: None, most: Some(10.0) },
    DefaultValue::Absent,
);
/// λ.
pub const NORMAL_WEIGHT: Parameter = Parameter::new(
    "normal_weight",
    "λ in the rows λ ∂f = slope that the particles' normals add to those of their positions in a reconstruction, in a flow; when not given, .1 in \
     space, 0 in the plane",
    Kind::Number { above: None, least: Some(0.0), below: None, most: Some(10.0) },
    DefaultValue::Absent,
);
/// γ.
pub const TUBE_RADIUS: Parameter = Parameter::new(
    "tube_radius_h",
    "grid points within so many h of the front have a foot-point",
    Kind::Number { above: None, least: Some(0.8), below: None, most: Some(4.0) },
    DefaultValue::Json("1.1"),
);
/// Separation.
pub const MIN_SEPARATION: Parameter = Parameter::new(
    "min_separation_h",
    "distance in h that the particles of a reconstruction keep from each other",
    Kind::Number { above: None, least: Some(0.0), below: None, most: Some(1.0) },
    DefaultValue::Json("0.25"),
);
/// Segments.
pub const SEGMENT_TEST: Parameter = Parameter::new(
    "segment_test",
    "how particles of different segments are told apart",
    Kind::Choice(segment_tests),
    DefaultValue::Json("\"normals\""),
);
/// Topology.
pub const TOPOLOGY: Parameter = Parameter::new(
    "topology",
    "what happens where segments meet: they merge (the viscosity solution) or cross (parts are told apart by their parameter)",
    Kind::Word(&["merge", "cross"]),
    DefaultValue::Json("\"merge\""),
);
/// Refinement.
pub const ADAPTIVITY: Parameter = Parameter::new(
    "adaptivity",
    "refines the grid where the front is curved or close to another segment; when not given, the grid has one level",
    Kind::Group(ADAPTIVITY_PARAMETERS),
    DefaultValue::Absent,
);

static ADAPTIVITY_PARAMETERS: &[Parameter] = &[
    Parameter::new(
        "levels",
        "levels of the grid: the coarsest has the spacing, each other half of that before",
        Kind::Integer { least: 1, most: MOST_LEVELS as u64 },
        DefaultValue::Json("3"),
    ),
    Parameter::new(
        "curvature_constant",
        "c: cells are halved as long as |κ| times their size is not below it",
        POSITIVE,
        DefaultValue::Json("0.2"),
    ),
];

/// Step.
pub const CFL: Parameter = Parameter::new(
    "cfl",
    "dt · max speed/h, h that of the finest level; when neither it nor a step is given, 10 in a flow, 2 of rays, .75 with a given speed, and dt = .5 h² under \
     mean_curvature, or the longest that is stable where that is less",
    POSITIVE,
    DefaultValue::Absent,
);

/// All of them.
pub static PARAMETERS: &[Parameter] =
    &[DEGREE, NEIGHBORS, WEIGHT, NORMAL_WEIGHT, TUBE_RADIUS, MIN_SEPARATION, SEGMENT_TEST, ADAPTIVITY, CFL];

const COSINE: Parameter = Parameter::new(
    "cosine",
    "normals of one segment have a larger scalar product; when not given, .2 in the plane and .5 in space, −.2 and −.05 under \
     mean_curvature",
    Kind::Number { above: Some(-1.0), least: None, below: Some(1.0), most: None },
    DefaultValue::Absent,
);

static SEGMENT_TESTS: &[Variant] = &[
    Variant { name: "normals", doc: "by the angle of their normals", parameters: &[COSINE] },
    Variant {
        name: "parameter",
        doc: "by the part of the front at the start that they belong to, and in the plane by how far along it they are, from 0 to 1 \
              round it, both carried along by the fits; and by the angle of their normals",
        parameters: &[
            COSINE,
            Parameter::new(
                "difference",
                "parameters of one segment differ by less",
                Kind::Number { above: Some(0.0), least: None, below: None, most: Some(0.5) },
                DefaultValue::Json("0.1"),
            ),
        ],
    },
];

fn segment_tests() -> &'static [Variant] {
    SEGMENT_TESTS
}

/// Adds what the paper reconstructs by: quadratics of 6 particles, in space of 10, without weights and normals; where another degree is
/// given the number of particles is left to it.
pub fn lay_paper_method(preset: &mut Map<String, Value>, given: Option<&Map<String, Value>>, is_in_space: bool) {
    preset.insert("degree".into(), json!(2));
    preset.insert("weight".into(), json!(0));
    preset.insert("normal_weight".into(), json!(0));
    if given.and_then(|given| given.get("degree")).is_none_or(|degree| *degree == json!(2)) {
        preset.insert("neighbors".into(), json!(if is_in_space { 10 } else { 6 }));
    }
}

/// As checked.
#[derive(Debug, Clone, Deserialize)]
pub struct Written {
    degree: Option<usize>,
    neighbors: Option<usize>,
    weight: Option<f64>,
    normal_weight: Option<f64>,
    tube_radius_h: f64,
    min_separation_h: f64,
    segment_test: SegmentTest,
    adaptivity: Option<Adaptivity>,
    /// None where the scene has no choice.
    topology: Option<String>,
    /// dt · max speed/h.
    pub cfl: Option<f64>,
}

impl Written {
    /// How many levels the grid has.
    #[must_use]
    pub fn levels(&self) -> u32 {
        self.adaptivity.map_or(1, |adaptivity| adaptivity.levels)
    }

    /// The degree, chosen where none is given.
    #[must_use]
    pub fn degree_for(&self, dimension: usize, motion: Motion) -> usize {
        self.degree.unwrap_or(if dimension == 2 || motion == Motion::Curvature { 4 } else { 2 })
    }

    /// The weight, chosen where none is given.
    #[must_use]
    pub fn weight_for(&self, dimension: usize, motion: Motion) -> f64 {
        let is_narrow = dimension == 2 && motion != Motion::Curvature && self.degree_for(dimension, motion) == 4;
        self.weight.unwrap_or(if is_narrow { 1.0 } else { 0.0 })
    }
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct Adaptivity {
    levels: u32,
    curvature_constant: f64,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum SegmentTest {
    Normals { cosine: Option<f64> },
    Parameter { cosine: Option<f64>, difference: f64 },
}

/// What they mean.
#[derive(Debug, Clone, Copy)]
pub struct Chosen {
    /// Reconstruction.
    pub method: FrontMethod,
    /// Where segments meet.
    pub topology: Topology,
    /// How segments are told apart beside their normals.
    pub segments: Segments,
}

/// λ from which on the normals do what more particles would: with less, few particles are unstable.
const NORMALS_DETERMINE: f64 = 0.1;

/// What moves the front, as far as it matters to reconstructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// A flow: particles and their normals are exact by themselves.
    Flow,
    /// Its mean curvature.
    Curvature,
    /// A given speed, or rays.
    Speed,
}

/// The method of checked parameters, and the parameters with what was left open.
///
/// # Errors
/// Where there are fewer particles than coefficients, and where normals cannot take part.
pub fn understand(
    written: &Written,
    json: &Value,
    pointer: &str,
    dimension: usize,
    motion: Motion,
) -> Result<(Chosen, Value), Vec<Violation>> {
    let mut violations = Vec::new();
    let is_by_curvature = motion == Motion::Curvature;
    let (degree, weight) = (written.degree_for(dimension, motion), written.weight_for(dimension, motion));
    let terms = if dimension == 2 { degree + 1 } else { (degree + 1) * (degree + 2) / 2 };
    if let Some(given) = written.normal_weight.filter(|given| *given > 0.0 && motion != Motion::Flow) {
        let detail = "normals of a surface take part in reconstructions in a flow, which carries them along exactly";
        violations.push(Violation::new(
            format!("{pointer}/normal_weight"),
            "conflict",
            detail,
            &json!(given),
            json!(0),
        ));
    }
    let has_normals = dimension == 3 && motion == Motion::Flow;
    let normal_weight = written.normal_weight.unwrap_or(if has_normals { 0.1 } else { 0.0 });
    let neighbors = written.neighbors.unwrap_or(match (dimension, degree) {
        (2, 2) => 6,
        (2, 3) => 7,
        (2, 4) if is_by_curvature => 10,
        (2, _) => 8,
        (_, 4) if is_by_curvature => 36,
        (_, _) if has_normals && normal_weight >= NORMALS_DETERMINE => terms,
        (_, 2 | 3) => 16,
        _ => 24,
    });
    let (fewest, detail) = if is_by_curvature {
        let detail = format!("with fewer particles of degree {degree} motion by curvature is unstable");
        (fewest_particles(dimension, degree), detail)
    } else {
        (terms, format!("a reconstruction of degree {degree} has {terms} coefficients"))
    };
    if neighbors < fewest {
        let allowed = json!(format!("a whole number ≥ {fewest}"));
        violations.push(Violation::new(format!("{pointer}/neighbors"), "range", detail, &json!(neighbors), allowed));
    }
    let most_weight = most_weight(dimension);
    if is_by_curvature && weight > most_weight {
        let detail = "with larger weights motion by curvature is unstable";
        let allowed = json!(format!("a number ≤ {most_weight}"));
        violations.push(Violation::new(format!("{pointer}/weight"), "range", detail, &json!(weight), allowed));
    }
    if !violations.is_empty() {
        return Err(violations);
    }
    let topology = if written.topology.as_deref() == Some("cross") { Topology::Cross } else { Topology::Merge };
    let is_crossing = topology == Topology::Cross;
    let (segments, cosine) = match written.segment_test {
        SegmentTest::Normals { cosine } => (Segments { by_part: is_crossing, parameter: None }, cosine),
        SegmentTest::Parameter { cosine, difference } => {
            // Outlines are known in the plane alone.
            let parameter = (dimension == 2).then_some(difference);
            (Segments { by_part: true, parameter }, cosine)
        }
    };
    // By its curvature a corner becomes round at once, so its two sides must find each other.
    let cosine = cosine.unwrap_or(match (dimension, is_by_curvature) {
        (2, false) => 0.2,
        (2, true) => -0.2,
        (_, false) => 0.5,
        (_, true) => -0.05,
    });
    let mut resolved = json.clone();
    resolved["degree"] = json!(degree);
    resolved["neighbors"] = json!(neighbors);
    resolved["weight"] = json!(weight);
    resolved["normal_weight"] = json!(normal_weight);
    resolved["segment_test"]["cosine"] = json!(cosine);
    let (tube_radius, min_separation) = (written.tube_radius_h, written.min_separation_h);
    let adaptivity = written
        .adaptivity
        .map(|Adaptivity { levels, curvature_constant }| gbpm::Adaptivity { levels, curvature_constant });
    let method =
        FrontMethod { degree, neighbors, weight, normal_weight, tube_radius, min_separation, cosine, adaptivity };
    Ok((Chosen { method, topology, segments }, resolved))
}
