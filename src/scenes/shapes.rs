//! Shapes as parameters: their JSON and the surfaces they stand for.

use crate::geometry::Vector;
use crate::geometry::surfaces::{Ball, Cuboid, Dumbbell, Ellipsoid, RoundedCuboid, Surface, Torus, Union, ZalesakDisk};
use crate::scene::schema::POSITIVE;
use crate::scene::{DefaultValue, Kind, Parameter, Variant, Violation};
use crate::scenes::dimension::in_dimension;
use serde::Deserialize;
use serde_json::{Map, Value, json};

const CENTER: Parameter = Parameter::new(
    "center",
    "centre; the origin when not given",
    Kind::Vector { positive: false },
    DefaultValue::Absent,
);

const fn positive(name: &'static str, doc: &'static str) -> Parameter {
    Parameter::new(name, doc, POSITIVE, DefaultValue::Required)
}

const BALL: &[Parameter] = &[CENTER, positive("radius", "radius")];
const ELLIPSOID: &[Parameter] = &[
    CENTER,
    Parameter::new(
        "semi_axes",
        "semi-axes along x, y (and z)",
        Kind::Vector { positive: true },
        DefaultValue::Required,
    ),
];
const SIZE: Parameter =
    Parameter::new("size", "full edge lengths", Kind::Vector { positive: true }, DefaultValue::Required);

macro_rules! plain_shapes {
    ($($more:expr),*) => {
        &[
            Variant { name: "circle", doc: "circle (2D)", parameters: BALL },
            Variant { name: "sphere", doc: "sphere (3D)", parameters: BALL },
            Variant { name: "ellipse", doc: "ellipse with axes along the coordinates (2D)", parameters: ELLIPSOID },
            Variant { name: "ellipsoid", doc: "ellipsoid with axes along the coordinates (3D)", parameters: ELLIPSOID },
            Variant { name: "box", doc: "rectangle or cuboid", parameters: &[CENTER, SIZE] },
            Variant {
                name: "rounded_box",
                doc: "rectangle or cuboid with rounded edges",
                parameters: &[CENTER, SIZE, positive("corner_radius", "radius of the rounding, less than half of every edge")],
            },
            Variant {
                name: "zalesak_disk",
                doc: "disk with a slot cut in from below (2D)",
                parameters: &[
                    CENTER,
                    positive("radius", "radius of the disk"),
                    positive("slot_width", "width of the slot, less than the diameter"),
                    positive("slot_depth", "height of the slot above the lowest point of the disk"),
                ],
            },
            Variant {
                name: "torus",
                doc: "torus about the z axis (3D)",
                parameters: &[
                    CENTER,
                    positive("major_radius", "radius of the core circle"),
                    positive("minor_radius", "radius of the tube, less than the major radius"),
                ],
            },
            Variant {
                name: "dumbbell",
                doc: "two balls on the x axis joined by a straight neck",
                parameters: &[
                    CENTER,
                    positive("separation", "distance of the balls' centres"),
                    positive("radius", "radius of the balls"),
                    positive("neck_radius", "radius of the neck, less than the balls'"),
                ],
            },
            $($more,)*
        ]
    };
}

static PLAIN: &[Variant] = plain_shapes!();
const UNION: Variant = Variant {
    name: "union",
    doc: "separate shapes taken together",
    parameters: &[Parameter::new(
        "of",
        "the shapes; they must not overlap",
        Kind::Choices { variants: || PLAIN, least: 1 },
        DefaultValue::Required,
    )],
};

/// Points from an upload or a file: frames of earlier runs are such files.
pub const POINTS: Variant = Variant {
    name: "points",
    doc: "points of a VTKHDF file; as a shape with PointData/phi, which is their level",
    parameters: &[
        Parameter::new("upload", "id of an upload that is ready", Kind::Text, DefaultValue::Absent),
        Parameter::new("file", "path of a file (valid for `meniscus run` alone)", Kind::Text, DefaultValue::Absent),
    ],
};

static ALL: &[Variant] = plain_shapes!(UNION, POINTS);

/// The variants of `shape`.
#[must_use]
pub fn variants() -> &'static [Variant] {
    ALL
}

/// A shape, as checked.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Shape {
    Circle { center: Option<Vec<f64>>, radius: f64 },
    Sphere { center: Option<Vec<f64>>, radius: f64 },
    Ellipse { center: Option<Vec<f64>>, semi_axes: Vec<f64> },
    Ellipsoid { center: Option<Vec<f64>>, semi_axes: Vec<f64> },
    Box { center: Option<Vec<f64>>, size: Vec<f64> },
    RoundedBox { center: Option<Vec<f64>>, size: Vec<f64>, corner_radius: f64 },
    ZalesakDisk { center: Option<Vec<f64>>, radius: f64, slot_width: f64, slot_depth: f64 },
    Torus { center: Option<Vec<f64>>, major_radius: f64, minor_radius: f64 },
    Dumbbell { center: Option<Vec<f64>>, separation: f64, radius: f64, neck_radius: f64 },
    Union { of: Vec<Shape> },
}

/// The dimension that a checked shape implies: by its type, else by the length of its vectors.
#[must_use]
pub fn implied_dimension(shape: &Value) -> Option<usize> {
    let length = |name: &str| shape.get(name).and_then(Value::as_array).map(Vec::len);
    match shape.get("type").and_then(Value::as_str)? {
        "circle" | "ellipse" | "zalesak_disk" => Some(2),
        "sphere" | "ellipsoid" | "torus" => Some(3),
        "union" => shape.get("of")?.as_array()?.iter().find_map(implied_dimension),
        _ => length("size").or_else(|| length("center")),
    }
}

/// Whether a scene as written is of three dimensions: as it says, else as its shape implies.
#[must_use]
pub fn is_in_space(given: &Map<String, Value>) -> bool {
    let implied = || given.get("shape").and_then(implied_dimension).map(|dimension| dimension as u64);
    given.get("dimension").and_then(Value::as_u64).or_else(implied) == Some(3)
}

/// The surface of a checked shape in `D` dimensions. Pointers of violations start with `pointer`.
///
/// # Errors
/// Everything that does not fit together.
pub fn surface<const D: usize>(shape: &Value, pointer: &str) -> Result<Box<dyn Surface<D>>, Vec<Violation>> {
    let parsed: Shape = serde_json::from_value(shape.clone())
        .map_err(|error| vec![Violation::new(pointer, "type", error.to_string(), shape, Value::Null)])?;
    parsed.build::<D>(shape, pointer)
}

/// The parts of a checked shape: those of a union, else the shape itself.
///
/// # Errors
/// As [`surface`].
pub fn parts<const D: usize>(shape: &Value, pointer: &str) -> Result<Vec<Box<dyn Surface<D>>>, Vec<Violation>> {
    // The whole first: parts must not overlap.
    let whole = surface::<D>(shape, pointer)?;
    match shape.get("of").and_then(Value::as_array) {
        Some(of) => of.iter().enumerate().map(|(k, part)| surface::<D>(part, &format!("{pointer}/of/{k}"))).collect(),
        None => Ok(vec![whole]),
    }
}

/// The ball that a checked shape is, if it is one.
#[must_use]
pub fn ball<const D: usize>(shape: &Value) -> Option<Ball<D>> {
    match serde_json::from_value(shape.clone()).ok()? {
        Shape::Circle { center, radius } | Shape::Sphere { center, radius } => {
            let center = center.unwrap_or_else(|| vec![0.0; D]);
            (center.len() == D).then(|| Ball { center: Vector::<D>::from_column_slice(&center), radius })
        }
        _ => None,
    }
}

impl Shape {
    fn build<const D: usize>(&self, written: &Value, pointer: &str) -> Result<Box<dyn Surface<D>>, Vec<Violation>> {
        let mut violations = Vec::new();
        let only = |dimension: usize, violations: &mut Vec<Violation>| {
            if D != dimension {
                let detail = format!("this shape exists in {dimension} dimensions, the scene has {D}");
                violations.push(Violation::new(
                    format!("{pointer}/type"),
                    "conflict",
                    detail,
                    &written["type"],
                    Value::Null,
                ));
            }
        };
        let vector = |name: &str, numbers: &[f64], violations: &mut Vec<Violation>| {
            if numbers.len() != D {
                let detail = format!("the scene has {D} dimensions");
                let allowed = json!(format!("{D} numbers"));
                violations.push(Violation::new(
                    format!("{pointer}/{name}"),
                    "conflict",
                    detail,
                    &json!(numbers),
                    allowed,
                ));
            }
            Vector::<D>::from_fn(|d, _| numbers.get(d).copied().unwrap_or(1.0))
        };
        let place = |center: &Option<Vec<f64>>, violations: &mut Vec<Violation>| match center {
            Some(numbers) => vector("center", numbers, violations),
            None => Vector::<D>::zeros(),
        };
        let less = |name: &str, got: f64, bound: f64, violations: &mut Vec<Violation>| {
            if got >= bound {
                let allowed = json!(format!("a number > 0 and < {bound}"));
                violations.push(Violation::new(
                    format!("{pointer}/{name}"),
                    "range",
                    "it does not fit the shape",
                    &json!(got),
                    allowed,
                ));
            }
        };
        let errors = &mut violations;
        let surface: Option<Box<dyn Surface<D>>> = match self {
            Self::Circle { center, radius } | Self::Sphere { center, radius } => {
                only(if matches!(self, Self::Circle { .. }) { 2 } else { 3 }, errors);
                Some(Box::new(Ball { center: place(center, errors), radius: *radius }))
            }
            Self::Ellipse { center, semi_axes } | Self::Ellipsoid { center, semi_axes } => {
                only(if matches!(self, Self::Ellipse { .. }) { 2 } else { 3 }, errors);
                Some(Box::new(Ellipsoid {
                    center: place(center, errors),
                    semi_axes: vector("semi_axes", semi_axes, errors),
                }))
            }
            Self::Box { center, size } => {
                Some(Box::new(Cuboid { center: place(center, errors), size: vector("size", size, errors) }))
            }
            Self::RoundedBox { center, size, corner_radius } => {
                less("corner_radius", *corner_radius, 0.5 * size.iter().copied().fold(f64::INFINITY, f64::min), errors);
                let (center, size) = (place(center, errors), vector("size", size, errors));
                Some(Box::new(RoundedCuboid { center, size, corner_radius: *corner_radius }))
            }
            Self::ZalesakDisk { center, radius, slot_width, slot_depth } => {
                only(2, errors);
                less("slot_width", *slot_width, 2.0 * radius, errors);
                let half = 0.5 * slot_width;
                let roof = radius + (radius * radius - half * half).max(0.0).sqrt();
                less("slot_depth", *slot_depth, roof, errors);
                // Where the circle meets the slot's sides, above the lowest point.
                let mouth = radius - (radius * radius - half * half).max(0.0).sqrt();
                if *slot_depth <= mouth {
                    let allowed = json!(format!("a number > {mouth}"));
                    let detail = "the slot would end below its own mouth";
                    let at = format!("{pointer}/slot_depth");
                    errors.push(Violation::new(at, "range", detail, &json!(slot_depth), allowed));
                }
                let center = place(center, errors);
                let flat = Vector::<2>::new(center[0], center[1]);
                let disk: Box<dyn Surface<2>> = Box::new(ZalesakDisk::new(flat, *radius, *slot_width, *slot_depth));
                in_dimension(disk)
            }
            Self::Torus { center, major_radius, minor_radius } => {
                only(3, errors);
                less("minor_radius", *minor_radius, *major_radius, errors);
                let center = place(center, errors);
                let center = Vector::<3>::from_fn(|d, _| if d < D { center[d] } else { 0.0 });
                let torus: Box<dyn Surface<3>> =
                    Box::new(Torus { center, major_radius: *major_radius, minor_radius: *minor_radius });
                in_dimension(torus)
            }
            Self::Dumbbell { center, separation, radius, neck_radius } => {
                less("neck_radius", *neck_radius, *radius, errors);
                let joint = 2.0 * (radius * radius - neck_radius * neck_radius).max(0.0).sqrt();
                if *separation <= joint {
                    let allowed = json!(format!("a number > {joint}"));
                    let detail = "the balls would swallow the neck";
                    errors.push(Violation::new(
                        format!("{pointer}/separation"),
                        "range",
                        detail,
                        &json!(separation),
                        allowed,
                    ));
                }
                Some(Box::new(Dumbbell::new(place(center, errors), *separation, *radius, *neck_radius)))
            }
            Self::Union { of } => {
                let mut parts = Vec::new();
                for (k, part) in of.iter().enumerate() {
                    match part.build::<D>(&written["of"][k], &format!("{pointer}/of/{k}")) {
                        Ok(surface) => parts.push(surface),
                        Err(found) => errors.extend(found),
                    }
                }
                if errors.is_empty() {
                    match Union::new(parts) {
                        Ok(union) => Some(Box::new(union)),
                        Err(overlap) => {
                            let at = format!("{pointer}/of");
                            errors.push(Violation::new(
                                at,
                                "conflict",
                                overlap.to_string(),
                                &written["of"],
                                Value::Null,
                            ));
                            None
                        }
                    }
                } else {
                    None
                }
            }
        };
        match surface {
            Some(surface) if violations.is_empty() => Ok(surface),
            _ => Err(violations),
        }
    }
}
