//! The JSON of a `surface_pde` scene.

use crate::scene::schema::{NOT_NEGATIVE, POSITIVE};
use crate::scene::{DefaultValue, Kind, Parameter, Variant};
use crate::scenes::shapes;
use serde::Deserialize;
use serde_json::{Map, Value};

/// A number of at least one.
const WHOLE: Kind = Kind::Integer { least: 1, most: 100_000_000 };

pub(super) static PARAMETERS: &[Parameter] = &[
    Parameter::new(
        "surface",
        "the surface, about the origin",
        Kind::Choice(|| SURFACES),
        DefaultValue::Json("\"sphere\""),
    ),
    Parameter::new(
        "dimension",
        "that of the surface: 2 for circles, of points when it is given, else 3",
        Kind::Integer { least: 2, most: 3 },
        DefaultValue::Absent,
    ),
    Parameter::new(
        "count",
        "number of points; of a bump about; 4000 when not given",
        Kind::Integer { least: 20, most: 100_000_000 },
        DefaultValue::Absent,
    ),
    Parameter::new(
        "sampling",
        "how points are spread: `regular` on circles and bumps, else `fibonacci`, when not given; `random` is relaxed",
        Kind::Word(&["fibonacci", "regular", "random", "random_raw"]),
        DefaultValue::Absent,
    ),
    Parameter::new(
        "problem",
        "what is computed",
        Kind::Choice(|| PROBLEMS),
        DefaultValue::Json("\"laplace_beltrami\""),
    ),
    Parameter::new("method", "the method", Kind::Choice(|| METHODS), DefaultValue::Json("\"surface_dcpse\"")),
    Parameter::new(
        "normals",
        "the normals that operators are made with; `given` for points, else `exact`, when not given",
        Kind::Choice(|| NORMALS),
        DefaultValue::Absent,
    ),
    Parameter::new(
        "solver",
        "how systems of equations are solved: those of `poisson` and of `bdf2`",
        Kind::Choice(|| SOLVERS),
        DefaultValue::Json("\"bicgstab\""),
    ),
    Parameter::new(
        "seed",
        "of random points and normals",
        Kind::Integer { least: 0, most: u64::MAX },
        DefaultValue::Json("1"),
    ),
    Parameter::restart_safe(
        "repeat",
        "applications of the operator in a row, one a step; of `laplace_beltrami`",
        Kind::Integer { least: 1, most: 1_000_000 },
        DefaultValue::Json("1"),
    ),
];

static SURFACES: &[Variant] = &[
    Variant { name: "circle", doc: "a circle in the plane", parameters: RADIUS },
    Variant { name: "sphere", doc: "a sphere", parameters: RADIUS },
    Variant {
        name: "ellipsoid",
        doc: "an ellipsoid; its Fibonacci points are those of the unit sphere, stretched",
        parameters: &[Parameter::new(
            "semi_axes",
            "along x, y and z",
            Kind::Vector { positive: true },
            DefaultValue::Json("[1, 0.8, 0.75]"),
        )],
    },
    Variant {
        name: "torus",
        doc: "a torus about z",
        parameters: &[
            Parameter::new("major_radius", "of the core circle", POSITIVE, DefaultValue::Json("1")),
            Parameter::new("minor_radius", "of the tube, below the major one", POSITIVE, DefaultValue::Json("0.4")),
        ],
    },
    Variant {
        name: "bump",
        doc: "the square [−2, 2]² with a bump α ζ(|x − p|/r) of r = 0.25 at p = (−0.5, 0), edges without flux",
        parameters: &[Parameter::new(
            "height",
            "α",
            Kind::Number { above: None, least: Some(0.0), below: None, most: Some(10.0) },
            DefaultValue::Json("1"),
        )],
    },
    Variant {
        name: "points",
        doc: "points of a file (HDF5, PLY, OBJ, XYZ), with normals where it has some; nothing is known of it exactly",
        parameters: shapes::POINTS.parameters,
    },
];

const RADIUS: &[Parameter] = &[Parameter::new("radius", "R", POSITIVE, DefaultValue::Json("1"))];

const FIELD: Parameter = Parameter::new(
    "field",
    "the field; `spherical_harmonic` on spheres, `sin_plus_cos` on circles, else `plane_wave` when not given",
    Kind::Choice(|| FIELDS),
    DefaultValue::Absent,
);
const END_TIME: Parameter = Parameter::new("end_time", "T", POSITIVE, DefaultValue::Json("1"));
const TIME_STEP: Parameter = Parameter::new(
    "time_step",
    "Δt; when not given, a hundredth of T, which `dopri5` divides as its tolerance asks",
    POSITIVE,
    DefaultValue::Absent,
);
const TOLERANCE: Parameter = Parameter::new(
    "tolerance",
    "root mean square of the error of a step by 1 + |u|; 1e-7 when neither it nor Δt is given, steps of Δt when only Δt is",
    Kind::Number { above: None, least: Some(1e-14), below: None, most: Some(1.0) },
    DefaultValue::Absent,
);

static PROBLEMS: &[Variant] = &[
    Variant { name: "laplace_beltrami", doc: "Δₛ of a field: `value` against `reference`", parameters: &[FIELD] },
    Variant {
        name: "poisson",
        doc: "Δₛ u = Δₛ of a field: `value` is u, `reference` the field; on points Δₛ u = the field less its mean",
        parameters: &[
            FIELD,
            Parameter::new(
                "condition",
                "points next to the plane x = 0 (on a circle the one at (R, 0)) hold their value, or u has no mean",
                Kind::Word(&["dirichlet", "zero_mean"]),
                DefaultValue::Json("\"zero_mean\""),
            ),
        ],
    },
    Variant {
        name: "diffusion",
        doc: "∂u/∂t = Δₛ u",
        parameters: &[
            Parameter::new(
                "initial",
                "u at the start; `truncated_gaussian` on bumps, else an eigenfunction, when not given",
                Kind::Choice(|| INITIALS),
                DefaultValue::Absent,
            ),
            END_TIME,
            TIME_STEP,
            Parameter::new("integrator", "of time", Kind::Choice(|| INTEGRATORS), DefaultValue::Json("\"dopri5\"")),
            Parameter::new("edges", "of a bump", Kind::Word(&["neumann"]), DefaultValue::Json("\"neumann\"")),
        ],
    },
    Variant { name: "curvature", doc: "mean and Gauss curvature, from normals or from points alone", parameters: &[] },
    Variant {
        name: "reaction_diffusion",
        doc: "two substances that react and diffuse",
        parameters: &[
            Parameter::new("model", "the reaction", Kind::Choice(|| MODELS), DefaultValue::Json("\"brusselator\"")),
            Parameter::new("diffusivity", "of the first substance", POSITIVE, DefaultValue::Json("0.005")),
            Parameter::new("second_diffusivity", "of the second", POSITIVE, DefaultValue::Json("0.05")),
            Parameter::new(
                "noise",
                "amplitude of the random disturbance at the start",
                NOT_NEGATIVE,
                DefaultValue::Json("0.1"),
            ),
            Parameter::new(
                "manufactured",
                "a field f for which forcing makes u = u₀ (1 + f cos t/4), v = v₀ (1 − f cos t/4) exact",
                Kind::Choice(|| FIELDS),
                DefaultValue::Absent,
            ),
            Parameter::new("end_time", "T", POSITIVE, DefaultValue::Json("10")),
            TIME_STEP,
            TOLERANCE,
        ],
    },
];

static FIELDS: &[Variant] = &[
    Variant {
        name: "spherical_harmonic",
        doc: "real orthonormal Y_lm, on a sphere: m > 0 ∝ cos mφ, m < 0 ∝ sin |m|φ",
        parameters: FIELDS_OF_SPHERES,
    },
    Variant {
        name: "plane_wave",
        doc: "sin(k·x), on any surface",
        parameters: &[Parameter::new("k", "k", Kind::Vector { positive: false }, DefaultValue::Absent)],
    },
    Variant {
        name: "sin_plus_cos",
        doc: "sin mθ + cos mθ, on a circle",
        parameters: &[Parameter::new("m", "m, half the count at most", WHOLE, DefaultValue::Json("1"))],
    },
];

static INITIALS: &[Variant] = &[
    Variant { name: "spherical_harmonic", doc: "real orthonormal Y_lm, on a sphere", parameters: FIELDS_OF_SPHERES },
    Variant {
        name: "sin_plus_cos",
        doc: "sin mθ + cos mθ, on a circle",
        parameters: &[Parameter::new("m", "m, half the count at most", WHOLE, DefaultValue::Json("1"))],
    },
    Variant {
        name: "plane_wave",
        doc: "sin(k·x)",
        parameters: &[Parameter::new("k", "k", Kind::Vector { positive: false }, DefaultValue::Absent)],
    },
    Variant {
        name: "truncated_gaussian",
        doc: "ζ(|x − c|/σ)/σ² with ζ(d) = exp(−1/(1 − d²)) below d = 0.975 (Surface DC-PSE paper, section 4.4)",
        parameters: &[
            Parameter::new("center", "c", Kind::Vector { positive: false }, DefaultValue::Json("[0, 0, 0]")),
            Parameter::new("sigma", "σ", POSITIVE, DefaultValue::Json("0.2")),
        ],
    },
];

const FIELDS_OF_SPHERES: &[Parameter] = &[
    Parameter::new("l", "degree", Kind::Integer { least: 1, most: 64 }, DefaultValue::Json("4")),
    Parameter::new(
        "m",
        "order, a whole number from −l to l",
        Kind::Number { above: None, least: Some(-64.0), below: None, most: Some(64.0) },
        DefaultValue::Json("0"),
    ),
    Parameter::new("axis", "the axis it is counted about", Kind::Word(&["x", "y", "z"]), DefaultValue::Json("\"z\"")),
];

static INTEGRATORS: &[Variant] = &[
    Variant { name: "dopri5", doc: "Dormand and Prince's pair, explicit", parameters: &[TOLERANCE] },
    Variant {
        name: "bdf2",
        doc: "the second backward differentiation formula, implicit; `solver` solves it",
        parameters: &[],
    },
];

static MODELS: &[Variant] = &[
    Variant {
        name: "gray_scott",
        doc: "−u v² + F (1 − u), u v² − (F + k) v",
        parameters: &[
            Parameter::new("feed", "F", POSITIVE, DefaultValue::Json("0.04")),
            Parameter::new("kill", "k", POSITIVE, DefaultValue::Json("0.06")),
        ],
    },
    Variant {
        name: "brusselator",
        doc: "a − (b + 1) u + u² v, b u − u² v",
        parameters: &[
            Parameter::new("a", "a", POSITIVE, DefaultValue::Json("3")),
            Parameter::new("b", "b", POSITIVE, DefaultValue::Json("9")),
        ],
    },
];

static METHODS: &[Variant] = &[
    Variant {
        name: "surface_dcpse",
        doc: "Surface DC-PSE: fits of polynomials about every point",
        parameters: &[
            Parameter::new(
                "order",
                "2, 4 or 6: polynomials of degree 3, 5 or 7",
                Kind::Integer { least: 2, most: 6 },
                DefaultValue::Json("2"),
            ),
            Parameter::new(
                "form",
                "`intrinsic`: on tangent planes; `copies`: in space, with copies of the points along normals, the paper's",
                Kind::Word(&["intrinsic", "copies"]),
                DefaultValue::Json("\"intrinsic\""),
            ),
            Parameter::new(
                "cutoff_dn",
                "r_c by δn; 2.4, 3.3, 4.2 (of `random_raw` 3.5, 4, 4.5; copies 2.9, on circles 4.1) when not given",
                Kind::Number { above: Some(1.0), least: None, below: None, most: Some(20.0) },
                DefaultValue::Absent,
            ),
            Parameter::new(
                "layers",
                "copies of a point to either side; 2, on circles 4, when not given",
                Kind::Integer { least: 1, most: 16 },
                DefaultValue::Absent,
            ),
            Parameter::new(
                "normal_spacing",
                "δn of the copies; √(area/N), on circles 3 R/(N − 1), when not given",
                POSITIVE,
                DefaultValue::Absent,
            ),
        ],
    },
    Variant {
        name: "closest_point",
        doc: "the embedding closest-point method on a grid about the surface, for `laplace_beltrami`",
        parameters: &[
            Parameter::new("order", "2 or 4", Kind::Integer { least: 2, most: 4 }, DefaultValue::Json("2")),
            Parameter::new("spacing", "of the grid; √(area/N) when not given", POSITIVE, DefaultValue::Absent),
        ],
    },
];

static NORMALS: &[Variant] = &[
    Variant { name: "exact", doc: "those of the surface", parameters: &[] },
    Variant {
        name: "given",
        doc: "those that came with points, estimated where none did",
        parameters: &[Parameter::new(
            "metric",
            "`heights` are fitted, or normals are taken as exact (then they must have come)",
            Kind::Word(&["heights", "normals"]),
            DefaultValue::Json("\"heights\""),
        )],
    },
    Variant { name: "estimated", doc: "from the points alone, the metric by fitted heights", parameters: &[] },
    Variant {
        name: "perturbed",
        doc: "exact ones turned at random, the metric by fitted heights",
        parameters: &[
            Parameter::new("sigma", "largest change of a component", NOT_NEGATIVE, DefaultValue::Json("0.01")),
            Parameter::new(
                "metric",
                "`heights` are fitted, or normals are taken as if they were exact",
                Kind::Word(&["heights", "normals"]),
                DefaultValue::Json("\"heights\""),
            ),
        ],
    },
];

const SOLVER_TOLERANCE: Parameter = Parameter::new(
    "tolerance",
    "of ‖b − A x‖ by ‖b‖",
    Kind::Number { above: None, least: Some(1e-14), below: None, most: Some(0.1) },
    DefaultValue::Json("1e-10"),
);
const MOST_ITERATIONS: Parameter =
    Parameter::new("max_iterations", "iterations at most", WHOLE, DefaultValue::Json("5000"));

static SOLVERS: &[Variant] = &[
    Variant { name: "bicgstab", doc: "BiCGSTAB with ILU(0)", parameters: &[SOLVER_TOLERANCE, MOST_ITERATIONS] },
    Variant {
        name: "gmres",
        doc: "GMRES with ILU(0)",
        parameters: &[
            Parameter::new("restart", "vectors", Kind::Integer { least: 2, most: 1000 }, DefaultValue::Json("60")),
            SOLVER_TOLERANCE,
            MOST_ITERATIONS,
        ],
    },
    Variant { name: "sparse_lu", doc: "sparse LU decomposition", parameters: &[] },
];

/// There are none.
pub(super) fn preset(_name: &str, _given: &Map<String, Value>) -> Map<String, Value> {
    Map::new()
}

/// The scene as checked.
#[derive(Debug, Deserialize)]
pub(super) struct Written {
    pub surface: Value,
    pub dimension: Option<u64>,
    pub count: Option<u64>,
    pub sampling: Option<String>,
    pub problem: Value,
    pub method: Value,
    pub normals: Option<Value>,
    pub solver: Value,
    pub seed: u64,
    pub repeat: u64,
}
