//! Shapes as parameters, and the surfaces they stand for.

use crate::geometry::Vector;
use crate::geometry::dimension::in_dimension;
use crate::geometry::surfaces::{Ball, Cuboid, Dumbbell, Ellipsoid, RoundedCuboid, Surface, Torus, Union, ZalesakDisk};
use crate::scene::cloud::{CloudReference, PointsSource};
use crate::spec::{AtLeast, Choice, Coordinates, NOT_NEGATIVE, POSITIVE, Parameter, Sign, Violation};
use serde_json::{Value, json};

crate::choice! {
    /// A shape whose distance is known exactly.
    pub enum PlainShape {
        /// circle (2D)
        Circle = "circle" {
            /// center; the origin when not given
            center: Option<Coordinates>;
            /// radius
            radius: f64, in POSITIVE;
        }
        /// sphere (3D)
        Sphere = "sphere" {
            /// center; the origin when not given
            center: Option<Coordinates>;
            /// radius
            radius: f64, in POSITIVE;
        }
        /// ellipse with axes along the coordinates (2D)
        Ellipse = "ellipse" {
            /// center; the origin when not given
            center: Option<Coordinates>;
            /// semi-axes along x and y
            semi_axes: Coordinates, in Sign::Positive;
        }
        /// ellipsoid with axes along the coordinates (3D)
        Ellipsoid = "ellipsoid" {
            /// center; the origin when not given
            center: Option<Coordinates>;
            /// semi-axes along x, y and z
            semi_axes: Coordinates, in Sign::Positive;
        }
        /// rectangle or cuboid
        Box = "box" {
            /// center; the origin when not given
            center: Option<Coordinates>;
            /// full edge lengths
            size: Coordinates, in Sign::Positive;
        }
        /// rectangle or cuboid with rounded edges
        RoundedBox = "rounded_box" {
            /// center; the origin when not given
            center: Option<Coordinates>;
            /// full edge lengths
            size: Coordinates, in Sign::Positive;
            /// radius of the rounding, less than half of every edge
            corner_radius: f64, in POSITIVE;
        }
        /// disk with a slot cut in from below (2D)
        ZalesakDisk = "zalesak_disk" {
            /// center; the origin when not given
            center: Option<Coordinates>;
            /// radius of the disk
            radius: f64, in POSITIVE;
            /// width of the slot, less than the diameter
            slot_width: f64, in POSITIVE;
            /// height of the slot above the lowest point of the disk
            slot_depth: f64, in POSITIVE;
        }
        /// torus about the z axis (3D)
        Torus = "torus" {
            /// center; the origin when not given
            center: Option<Coordinates>;
            /// radius of the core circle
            major_radius: f64, in POSITIVE;
            /// radius of the tube, less than the major radius
            minor_radius: f64, in POSITIVE;
        }
        /// two balls on the x axis joined by a straight neck
        Dumbbell = "dumbbell" {
            /// center; the origin when not given
            center: Option<Coordinates>;
            /// distance of the centers of the balls
            separation: f64, in POSITIVE;
            /// radius of the balls
            radius: f64, in POSITIVE;
            /// radius of the neck, less than that of the balls
            neck_radius: f64, in POSITIVE;
        }
    }
}

crate::choice! {
    /// A shape: one that is known exactly, several of them, or points from outside.
    pub enum Shape {
        ..Plain(PlainShape)
        /// separate shapes taken together
        Union = "union" {
            /// the shapes; they must not overlap
            of: Vec<PlainShape>, in AtLeast(1);
        }
        /// a layer across a periodic box, between two sides at rest or in waves that are crests together (droplet)
        Layer = "layer" {
            /// height of its middle, along y
            height: f64 = 0.0;
            /// mean distance of its sides
            thickness: f64, in POSITIVE;
            /// amplitude of the waves on both sides
            amplitude: f64 = 0.0, in NOT_NEGATIVE;
            /// length of the waves along x, which divides the box; that of the box when not given
            wavelength: Option<f64>, in POSITIVE;
            /// place of a crest, along x
            crest: f64 = 0.0;
        }
        /// points of a VTKHDF file with PointData/phi, which is their level
        Points = "points" {
            /// where the points come from
            source: PointsSource => flatten;
        }
    }
}

impl Shape {
    /// The circle, or in space the sphere, of a radius about the origin.
    #[must_use]
    pub fn ball(dimension: usize, radius: f64) -> Self {
        Self::Plain(if dimension == 2 {
            PlainShape::Circle { center: None, radius }
        } else {
            PlainShape::Sphere { center: None, radius }
        })
    }

    /// The ellipse, or in space the ellipsoid, of these semi-axes about the origin; in the plane the first two count.
    #[must_use]
    pub fn ellipsoid(dimension: usize, semi_axes: [f64; 3]) -> Self {
        let axes = Coordinates(semi_axes.into_iter().take(dimension).collect());
        Self::Plain(if dimension == 2 {
            PlainShape::Ellipse { center: None, semi_axes: axes }
        } else {
            PlainShape::Ellipsoid { center: None, semi_axes: axes }
        })
    }

    /// The dimension that the shape implies: by its type, else by the length of its vectors.
    #[must_use]
    pub fn dimension(&self) -> Option<usize> {
        match self {
            Self::Plain(shape) => shape.dimension(),
            Self::Union { of } => of.iter().find_map(PlainShape::dimension),
            Self::Points { .. } | Self::Layer { .. } => None,
        }
    }

    /// Center and semi-axes of a circle, sphere, ellipse or ellipsoid, the zero of a quadric; none for other shapes.
    #[must_use]
    pub fn quadric<const D: usize>(&self) -> Option<(Vector<D>, Vector<D>)> {
        let at = |center: &Option<Coordinates>| {
            Vector::<D>::from_fn(|d, _| center.as_ref().and_then(|c| c.get(d)).copied().unwrap_or(0.0))
        };
        match self {
            Self::Plain(PlainShape::Circle { center, radius } | PlainShape::Sphere { center, radius }) => {
                Some((at(center), Vector::<D>::repeat(*radius)))
            }
            Self::Plain(PlainShape::Ellipse { center, semi_axes } | PlainShape::Ellipsoid { center, semi_axes }) => {
                Some((at(center), Vector::<D>::from_fn(|d, _| semi_axes.get(d).copied().unwrap_or(1.0))))
            }
            _ => None,
        }
    }

    /// The ball that the shape is, if it is one.
    #[must_use]
    pub fn as_ball<const D: usize>(&self) -> Option<Ball<D>> {
        let Self::Plain(PlainShape::Circle { center, radius } | PlainShape::Sphere { center, radius }) = self else {
            return None;
        };
        let numbers = center.as_ref().map_or_else(|| vec![0.0; D], |center| center.0.clone());
        (numbers.len() == D).then(|| Ball { center: Vector::<D>::from_column_slice(&numbers), radius: *radius })
    }

    /// The points from outside that the shape names, if it does. Errors are added to `errors`.
    pub fn points_reference(&self, pointer: &'static str, errors: &mut Vec<Violation>) -> Option<CloudReference> {
        match self {
            Self::Points { source } => source.reference(pointer, errors),
            Self::Plain(_) | Self::Union { .. } | Self::Layer { .. } => None,
        }
    }

    /// The surface of the shape in `D` dimensions. Pointers of errors begin with `pointer`.
    ///
    /// # Errors
    /// Everything that does not fit together; points from outside have no surface before they are read.
    pub fn surface<const D: usize>(&self, pointer: &str) -> Result<Box<dyn Surface<D>>, Vec<Violation>> {
        match self {
            Self::Plain(shape) => shape.surface::<D>(pointer),
            Self::Union { of } => {
                let whole = Union::new(parts_of::<D>(of, pointer)?);
                whole.map(|union| -> Box<dyn Surface<D>> { Box::new(union) }).map_err(|overlap| {
                    let at = format!("{pointer}/of");
                    vec![Violation::new(at, "conflict", overlap.to_string(), of.to_json(), Value::Null)]
                })
            }
            Self::Layer { .. } => {
                let detail = "a layer reaches across a periodic box: it belongs to droplet scenes";
                Err(vec![Violation::new(pointer, "conflict", detail, "layer", Value::Null)])
            }
            Self::Points { .. } => {
                let detail = "points from outside are not a shape that is known exactly";
                Err(vec![Violation::new(pointer, "conflict", detail, "points", Value::Null)])
            }
        }
    }

    /// The parts of the shape: those of a union, else the shape itself.
    ///
    /// # Errors
    /// As [`Self::surface`].
    pub fn parts<const D: usize>(&self, pointer: &str) -> Result<Vec<Box<dyn Surface<D>>>, Vec<Violation>> {
        // The whole first: parts must not overlap.
        let whole = self.surface::<D>(pointer)?;
        match self {
            Self::Union { of } => parts_of::<D>(of, pointer),
            _ => Ok(vec![whole]),
        }
    }
}

/// The surfaces of the members of a union, or all that is wrong with them.
fn parts_of<const D: usize>(of: &[PlainShape], pointer: &str) -> Result<Vec<Box<dyn Surface<D>>>, Vec<Violation>> {
    let mut errors = Vec::new();
    let mut surfaces = Vec::new();
    for (k, part) in of.iter().enumerate() {
        match part.surface::<D>(&format!("{pointer}/of/{k}")) {
            Ok(surface) => surfaces.push(surface),
            Err(found) => errors.extend(found),
        }
    }
    if errors.is_empty() { Ok(surfaces) } else { Err(errors) }
}

impl PlainShape {
    fn dimension(&self) -> Option<usize> {
        match self {
            Self::Circle { .. } | Self::Ellipse { .. } | Self::ZalesakDisk { .. } => Some(2),
            Self::Sphere { .. } | Self::Ellipsoid { .. } | Self::Torus { .. } => Some(3),
            Self::Box { size, .. } | Self::RoundedBox { size, .. } => Some(size.len()),
            Self::Dumbbell { center, .. } => center.as_ref().map(|center| center.len()),
        }
    }

    fn surface<const D: usize>(&self, pointer: &str) -> Result<Box<dyn Surface<D>>, Vec<Violation>> {
        let mut check = Fitting::<D> { shape: self.name(), pointer, errors: Vec::new() };
        let surface: Option<Box<dyn Surface<D>>> = match self {
            Self::Circle { center, radius } | Self::Sphere { center, radius } => {
                check.exists_in(if matches!(self, Self::Circle { .. }) { 2 } else { 3 });
                Some(Box::new(Ball { center: check.center(center), radius: *radius }))
            }
            Self::Ellipse { center, semi_axes } | Self::Ellipsoid { center, semi_axes } => {
                check.exists_in(if matches!(self, Self::Ellipse { .. }) { 2 } else { 3 });
                let (center, semi_axes) = (check.center(center), check.vector("semi_axes", semi_axes));
                Some(Box::new(Ellipsoid { center, semi_axes }))
            }
            Self::Box { center, size } => {
                Some(Box::new(Cuboid { center: check.center(center), size: check.vector("size", size) }))
            }
            Self::RoundedBox { center, size, corner_radius } => {
                check.is_below(
                    "corner_radius",
                    *corner_radius,
                    0.5 * size.iter().copied().fold(f64::INFINITY, f64::min),
                );
                let (center, size) = (check.center(center), check.vector("size", size));
                Some(Box::new(RoundedCuboid { center, size, corner_radius: *corner_radius }))
            }
            Self::ZalesakDisk { center, radius, slot_width, slot_depth } => {
                zalesak_disk(&mut check, center, *radius, [*slot_width, *slot_depth])
            }
            Self::Torus { center, major_radius, minor_radius } => {
                check.exists_in(3);
                check.is_below("minor_radius", *minor_radius, *major_radius);
                let center = check.center(center);
                let center = Vector::<3>::from_fn(|d, _| if d < D { center[d] } else { 0.0 });
                let torus: Box<dyn Surface<3>> =
                    Box::new(Torus { center, major_radius: *major_radius, minor_radius: *minor_radius });
                in_dimension(torus)
            }
            Self::Dumbbell { center, separation, radius, neck_radius } => {
                check.is_below("neck_radius", *neck_radius, *radius);
                let joint = 2.0 * (radius * radius - neck_radius * neck_radius).max(0.0).sqrt();
                check.is_above(
                    "separation",
                    *separation,
                    joint,
                    "the balls would touch and leave no neck between them",
                );
                Some(Box::new(Dumbbell::new(check.center(center), *separation, *radius, *neck_radius)))
            }
        };
        match surface {
            Some(surface) if check.errors.is_empty() => Ok(surface),
            _ => Err(check.errors),
        }
    }
}

fn zalesak_disk<const D: usize>(
    check: &mut Fitting<D>,
    center: &Option<Coordinates>,
    radius: f64,
    [slot_width, slot_depth]: [f64; 2],
) -> Option<Box<dyn Surface<D>>> {
    check.exists_in(2);
    check.is_below("slot_width", slot_width, 2.0 * radius);
    let half = 0.5 * slot_width;
    let height = (radius * radius - half * half).max(0.0).sqrt();
    check.is_below("slot_depth", slot_depth, radius + height);
    // Where the circle meets the sides of the slot, above the lowest point.
    check.is_above("slot_depth", slot_depth, radius - height, "the slot would end below its own mouth");
    let center = check.center(center);
    let disk: Box<dyn Surface<2>> =
        Box::new(ZalesakDisk::new(Vector::<2>::new(center[0], center[1]), radius, slot_width, slot_depth));
    in_dimension(disk)
}

/// Checks how the numbers of a shape fit together, and to the dimension of the scene.
struct Fitting<'a, const D: usize> {
    shape: &'static str,
    pointer: &'a str,
    errors: Vec<Violation>,
}

impl<const D: usize> Fitting<'_, D> {
    fn refuse(&mut self, name: &str, code: &'static str, detail: impl Into<String>, got: Value, allowed: Value) {
        self.errors.push(Violation::new(format!("{}/{name}", self.pointer), code, detail, got, allowed));
    }

    fn exists_in(&mut self, dimension: usize) {
        if D != dimension {
            let detail = format!("this shape exists in {dimension} dimensions, the scene has {D}");
            self.refuse("type", "conflict", detail, json!(self.shape), Value::Null);
        }
    }

    fn vector(&mut self, name: &str, numbers: &Coordinates) -> Vector<D> {
        if numbers.len() != D {
            let detail = format!("the scene has {D} dimensions");
            self.refuse(name, "conflict", detail, numbers.to_json(), json!(format!("{D} numbers")));
        }
        Vector::<D>::from_fn(|d, _| numbers.get(d).copied().unwrap_or(1.0))
    }

    fn center(&mut self, center: &Option<Coordinates>) -> Vector<D> {
        center.as_ref().map_or_else(Vector::<D>::zeros, |numbers| self.vector("center", numbers))
    }

    fn is_below(&mut self, name: &str, got: f64, bound: f64) {
        if got >= bound {
            let allowed = json!(format!("a number > 0 and < {bound}"));
            self.refuse(name, "range", "the number does not fit the other lengths of the shape", json!(got), allowed);
        }
    }

    fn is_above(&mut self, name: &str, got: f64, bound: f64, detail: &str) {
        if got <= bound {
            self.refuse(name, "range", detail, json!(got), json!(format!("a number > {bound}")));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{PlainShape, Shape};
    use crate::spec::{Parameter, Violation};
    use serde_json::{Value, json};

    fn parse(given: &Value) -> Result<Shape, Vec<Violation>> {
        let mut errors = Vec::new();
        Shape::parse(given, (), "/shape", &mut errors).ok_or(errors)
    }

    #[test]
    fn shapes_read_what_they_write() {
        for given in [
            json!({"type": "circle", "center": [0.5, 0.75], "radius": 0.15}),
            json!({"type": "union", "of": [{"type": "box", "center": null, "size": [1.0, 2.0]}]}),
            json!({"type": "points", "upload": "upl_1", "file": null}),
        ] {
            assert_eq!(parse(&given).unwrap().to_json(), given);
        }
    }

    #[test]
    fn unions_hold_plain_shapes_alone() {
        let nested = json!({"type": "union", "of": [{"type": "union", "of": []}]});
        let errors = parse(&nested).unwrap_err();
        assert_eq!((errors[0].pointer.as_str(), errors[0].code), ("/shape/of/0/type", "unknown"));
    }

    #[test]
    fn everything_that_does_not_fit_is_told_at_once() {
        let disk = PlainShape::ZalesakDisk {
            center: Some([0.0, 0.0, 0.0].into()),
            radius: 1.0,
            slot_width: 3.0,
            slot_depth: 9.0,
        };
        let places: Vec<String> =
            Shape::Plain(disk).surface::<2>("/shape").err().unwrap().into_iter().map(|error| error.pointer).collect();
        assert_eq!(places, ["/shape/slot_width", "/shape/slot_depth", "/shape/center"]);
    }

    #[test]
    fn a_shape_implies_its_dimension() {
        let dimension = |given: Value| parse(&given).unwrap().dimension();
        assert_eq!(dimension(json!({"type": "torus", "major_radius": 1, "minor_radius": 0.2})), Some(3));
        assert_eq!(dimension(json!({"type": "box", "size": [1, 1, 1]})), Some(3));
        assert_eq!(dimension(json!({"type": "dumbbell", "separation": 2, "radius": 0.5, "neck_radius": 0.1})), None);
    }
}
