//! Shapes of a few numbers, and the surfaces they stand for.

use crate::geometry::Vector;
use crate::geometry::dimension::in_dimension;
use crate::geometry::surfaces::{
    Ball, Cuboid, Dumbbell, Ellipsoid, Polygon, RoundedCuboid, Surface, Torus, ZalesakDisk,
};
use crate::spec::{Choice, Coordinates, POSITIVE, Parameter, Places, Sign, Violation};
use serde_json::{Value, json};
use std::sync::Arc;

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
        /// polygon by its corners, in either order (2D)
        Polygon = "polygon" {
            /// corners; the last one is joined to the first
            points: Places;
        }
    }
}

impl PlainShape {
    /// The dimension that the shape implies: by its type, else by the length of its vectors.
    pub(super) fn dimension(&self) -> Option<usize> {
        match self {
            Self::Circle { .. } | Self::Ellipse { .. } | Self::ZalesakDisk { .. } | Self::Polygon { .. } => Some(2),
            Self::Sphere { .. } | Self::Ellipsoid { .. } | Self::Torus { .. } => Some(3),
            Self::Box { size, .. } | Self::RoundedBox { size, .. } => Some(size.len()),
            Self::Dumbbell { center, .. } => center.as_ref().map(|center| center.len()),
        }
    }

    /// The surface of the shape in `D` dimensions. Pointers of errors begin with `pointer`.
    ///
    /// # Errors
    /// Everything that does not fit together.
    pub(super) fn surface<const D: usize>(&self, pointer: &str) -> Result<Arc<dyn Surface<D>>, Vec<Violation>> {
        let mut check = Fitting::<D> { shape: self.name(), pointer, errors: Vec::new() };
        let surface: Option<Arc<dyn Surface<D>>> = match self {
            Self::Circle { center, radius } | Self::Sphere { center, radius } => {
                check.exists_in(if matches!(self, Self::Circle { .. }) { 2 } else { 3 });
                Some(Arc::new(Ball { center: check.center(center), radius: *radius }))
            }
            Self::Ellipse { center, semi_axes } | Self::Ellipsoid { center, semi_axes } => {
                check.exists_in(if matches!(self, Self::Ellipse { .. }) { 2 } else { 3 });
                let (center, semi_axes) = (check.center(center), check.vector("semi_axes", semi_axes));
                Some(Arc::new(Ellipsoid { center, semi_axes }))
            }
            Self::Box { center, size } => {
                Some(Arc::new(Cuboid { center: check.center(center), size: check.vector("size", size) }))
            }
            Self::RoundedBox { center, size, corner_radius } => {
                check.is_below(
                    "corner_radius",
                    *corner_radius,
                    0.5 * size.iter().copied().fold(f64::INFINITY, f64::min),
                );
                let (center, size) = (check.center(center), check.vector("size", size));
                Some(Arc::new(RoundedCuboid { center, size, corner_radius: *corner_radius }))
            }
            Self::ZalesakDisk { center, radius, slot_width, slot_depth } => {
                zalesak_disk(&mut check, center, *radius, [*slot_width, *slot_depth])
            }
            Self::Torus { center, major_radius, minor_radius } => {
                check.exists_in(3);
                check.is_below("minor_radius", *minor_radius, *major_radius);
                let center = check.center(center);
                let center = Vector::<3>::from_fn(|d, _| if d < D { center[d] } else { 0.0 });
                let torus: Arc<dyn Surface<3>> =
                    Arc::new(Torus { center, major_radius: *major_radius, minor_radius: *minor_radius });
                in_dimension(torus)
            }
            Self::Polygon { points } => polygon(&mut check, points),
            Self::Dumbbell { center, separation, radius, neck_radius } => {
                check.is_below("neck_radius", *neck_radius, *radius);
                let joint = 2.0 * (radius * radius - neck_radius * neck_radius).max(0.0).sqrt();
                check.is_above(
                    "separation",
                    *separation,
                    joint,
                    "the balls would touch and leave no neck between them",
                );
                Some(Arc::new(Dumbbell::new(check.center(center), *separation, *radius, *neck_radius)))
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
) -> Option<Arc<dyn Surface<D>>> {
    check.exists_in(2);
    check.is_below("slot_width", slot_width, 2.0 * radius);
    let half = 0.5 * slot_width;
    let height = (radius * radius - half * half).max(0.0).sqrt();
    check.is_below("slot_depth", slot_depth, radius + height);
    // Where the circle meets the sides of the slot, above the lowest point.
    check.is_above("slot_depth", slot_depth, radius - height, "the slot would end below its own mouth");
    let center = check.center(center);
    let disk: Arc<dyn Surface<2>> =
        Arc::new(ZalesakDisk::new(Vector::<2>::new(center[0], center[1]), radius, slot_width, slot_depth));
    in_dimension(disk)
}

fn polygon<const D: usize>(check: &mut Fitting<D>, points: &Places) -> Option<Arc<dyn Surface<D>>> {
    check.exists_in(2);
    let mut corners = Vec::new();
    for (k, point) in points.0.iter().enumerate() {
        match point[..] {
            [x, y] => corners.push(Vector::<2>::new(x, y)),
            _ => check.refuse(
                &format!("points/{k}"),
                "conflict",
                "a polygon lies in the plane",
                point.to_json(),
                json!("2 numbers"),
            ),
        }
    }
    if corners.len() < points.0.len() {
        return None;
    }
    let polygon = Polygon::new(corners).map_err(|faults| {
        let allowed = json!("corners of edges that do not cross, at least 3");
        for fault in faults.iter().take(MOST_FAULTS) {
            check.refuse("points", "conflict", fault.to_string(), points.to_json(), allowed.clone());
        }
    });
    let polygon: Arc<dyn Surface<2>> = Arc::new(polygon.ok()?);
    in_dimension(polygon)
}

/// Faults of a polygon that are named.
const MOST_FAULTS: usize = 10;

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
