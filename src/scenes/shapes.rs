//! Shapes as parameters, and the surfaces they stand for.

mod known;
mod members;
mod plain;

pub use known::{KnownShape, Rotation, ShapeSurface};
pub use members::{Member, Members};
pub use plain::PlainShape;

use crate::geometry::Vector;
use crate::geometry::surfaces::Ball;
use crate::scene::cloud::{CloudReference, CloudRole, Clouds, PointsSource};
use crate::scene::mesh;
use crate::scenes::particle_estimate::check_extent;
use crate::spec::{Choice, Coordinates, NOT_NEGATIVE, POSITIVE, Violation};
use serde_json::Value;

crate::choice! {
    /// A shape: one that is known exactly, or points from outside.
    pub enum Shape {
        ..Known(KnownShape)
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
        /// a closed mesh of triangles from outside (STL, PLY, OBJ); in the plane points in order, which are the corners of a polygon
        Mesh = "mesh" {
            /// where the mesh comes from
            source: PointsSource => flatten;
        }
    }
}

impl Shape {
    /// A shape of a few numbers.
    #[must_use]
    pub fn plain(shape: PlainShape) -> Self {
        Self::Known(KnownShape::Plain(shape))
    }

    /// The shape of a few numbers that it is, if it is one.
    #[must_use]
    pub fn as_plain(&self) -> Option<&PlainShape> {
        let Self::Known(KnownShape::Plain(shape)) = self else { return None };
        Some(shape)
    }

    /// The circle, or in space the sphere, of a radius about the origin.
    #[must_use]
    pub fn ball(dimension: usize, radius: f64) -> Self {
        Self::plain(if dimension == 2 {
            PlainShape::Circle { center: None, radius }
        } else {
            PlainShape::Sphere { center: None, radius }
        })
    }

    /// The ellipse, or in space the ellipsoid, of these semi-axes about the origin; in the plane the first two count.
    #[must_use]
    pub fn ellipsoid(dimension: usize, semi_axes: [f64; 3]) -> Self {
        let axes = Coordinates(semi_axes.into_iter().take(dimension).collect());
        Self::plain(if dimension == 2 {
            PlainShape::Ellipse { center: None, semi_axes: axes }
        } else {
            PlainShape::Ellipsoid { center: None, semi_axes: axes }
        })
    }

    /// The dimension that the shape implies: by its type, else by the length of its vectors.
    #[must_use]
    pub fn dimension(&self) -> Option<usize> {
        match self {
            Self::Known(shape) => shape.dimension(),
            // Polygons from outside need the dimension of their scene.
            Self::Mesh { .. } => Some(3),
            Self::Points { .. } | Self::Layer { .. } => None,
        }
    }

    /// Center and semi-axes of a circle, sphere, ellipse or ellipsoid, the zero of a quadric; none for other shapes.
    #[must_use]
    pub fn quadric<const D: usize>(&self) -> Option<(Vector<D>, Vector<D>)> {
        let at = |center: &Option<Coordinates>| {
            Vector::<D>::from_fn(|d, _| center.as_ref().and_then(|c| c.get(d)).copied().unwrap_or(0.0))
        };
        match self.as_plain()? {
            PlainShape::Circle { center, radius } | PlainShape::Sphere { center, radius } => {
                Some((at(center), Vector::<D>::repeat(*radius)))
            }
            PlainShape::Ellipse { center, semi_axes } | PlainShape::Ellipsoid { center, semi_axes } => {
                Some((at(center), Vector::<D>::from_fn(|d, _| semi_axes.get(d).copied().unwrap_or(1.0))))
            }
            _ => None,
        }
    }

    /// The ball that the shape is, if it is one.
    #[must_use]
    pub fn as_ball<const D: usize>(&self) -> Option<Ball<D>> {
        let (PlainShape::Circle { center, radius } | PlainShape::Sphere { center, radius }) = self.as_plain()? else {
            return None;
        };
        let numbers = center.as_ref().map_or_else(|| vec![0.0; D], |center| center.0.clone());
        (numbers.len() == D).then(|| Ball { center: Vector::<D>::from_column_slice(&numbers), radius: *radius })
    }

    /// The points from outside that the shape names, if it does. Errors are added to `errors`.
    pub fn points_reference(&self, pointer: &'static str, errors: &mut Vec<Violation>) -> Option<CloudReference> {
        match self {
            Self::Points { source } => source.reference(pointer, CloudRole::Points, errors),
            Self::Mesh { source } => source.reference(pointer, CloudRole::Mesh, errors),
            Self::Known(_) | Self::Layer { .. } => None,
        }
    }

    /// Whether points from outside tell where the shape is, which are not known before a run.
    #[must_use]
    pub fn is_from_outside(&self) -> bool {
        matches!(self, Self::Points { .. } | Self::Mesh { .. })
    }

    /// The surface of the shape when a simulation is built: that which is known, or that of a mesh from outside; none of
    /// points with a level.
    ///
    /// # Errors
    /// Everything that keeps a mesh from being a closed surface, or from lying on a lattice of this spacing.
    pub fn surface_at_build<const D: usize>(
        &self,
        known: Option<&ShapeSurface<D>>,
        clouds: &Clouds,
        (reach, spacing): (f64, f64),
    ) -> Result<Option<ShapeSurface<D>>, Vec<Violation>> {
        let Self::Mesh { .. } = self else { return Ok(known.cloned()) };
        let surface = mesh::surface::<D>(clouds, "/shape")?;
        match check_extent(surface.as_ref(), reach, spacing) {
            Some(violation) => Err(vec![violation]),
            None => Ok(Some(ShapeSurface::single(surface))),
        }
    }

    /// The surface of the shape in `D` dimensions. Pointers of errors begin with `pointer`. A surface may take long to make:
    /// callers make it once.
    ///
    /// # Errors
    /// Everything that does not fit together; points from outside have no surface before they are read.
    pub fn surface<const D: usize>(&self, pointer: &str) -> Result<ShapeSurface<D>, Vec<Violation>> {
        match self {
            Self::Known(shape) => shape.surface::<D>(pointer),
            Self::Layer { .. } => {
                let detail = "a layer reaches across a periodic box: it belongs to droplet scenes";
                Err(vec![Violation::new(pointer, "conflict", detail, "layer", Value::Null)])
            }
            Self::Points { .. } | Self::Mesh { .. } => {
                let detail = "points from outside are not a shape that is known before they are read";
                Err(vec![Violation::new(pointer, "conflict", detail, self.name(), Value::Null)])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{PlainShape, Shape, Vector};
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
            json!({"type": "polygon", "points": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]}),
            json!({
                "type": "difference",
                "from": {"type": "intersection", "of": [
                    {"type": "circle", "center": null, "radius": 0.5}, {"type": "box", "center": null, "size": [1.0, 0.5]},
                ]},
                "minus": [{
                    "type": "transformed",
                    "of": {"type": "complement", "of": {"type": "circle", "center": null, "radius": 0.4}},
                    "rotate": {"angle": 0.5, "axis": null}, "scale": 1.0, "translate": [0.1, 0.0],
                }],
            }),
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
    fn all_errors_of_nested_shapes_come_at_once() {
        let given = json!({"type": "difference", "from": {"type": "ball"}, "minus": [
            {"type": "circle", "radius": -1}, {"type": "intersection", "of": []}, {"type": "complement"},
        ]});
        let found: Vec<(String, &str)> =
            parse(&given).unwrap_err().into_iter().map(|error| (error.pointer, error.code)).collect();
        let at = |pointer: &str, code| (format!("/shape/{pointer}"), code);
        assert_eq!(
            found,
            [
                at("from/type", "unknown"),
                at("minus/0/radius", "range"),
                at("minus/1/of", "type"),
                at("minus/2/of", "required"),
            ]
        );
        let given = json!({"type": "transformed", "translate": [1, 2, 3], "rotate": {"angle": 1, "axis": [0, 0, 1]}, "of": {
            "type": "intersection", "of": [
                {"type": "sphere", "radius": 1}, {"type": "polygon", "points": [[0, 0], [1, 1], [1, 0], [0, 1]]},
                {"type": "union", "of": [{"type": "circle", "radius": 1}, {"type": "circle", "radius": 2}]},
            ],
        }});
        let errors = parse(&given).unwrap().surface::<2>("/shape").err().unwrap();
        let places: Vec<&str> = errors.iter().map(|error| error.pointer.trim_start_matches("/shape/")).collect();
        assert_eq!(places, ["of/of/0/type", "of/of/1/points", "of/of/2/of", "translate", "rotate/axis"]);
        assert!(
            errors[1].detail.contains("edges 0 and 2 cross or touch near (0.5000, 0.5000)"),
            "{}",
            errors[1].detail
        );
    }

    #[test]
    fn what_leaves_nothing_and_what_is_nested_too_deeply_is_refused() {
        let nothing = json!({"type": "difference", "from": {"type": "circle", "radius": 0.5},
                             "minus": [{"type": "circle", "radius": 1.0}]});
        let errors = parse(&nothing).unwrap().surface::<2>("/shape").err().unwrap();
        assert_eq!((errors.len(), errors[0].pointer.as_str(), errors[0].code), (1, "/shape", "conflict"));
        let mut deep = json!({"type": "circle", "radius": 0.5});
        for _ in 0..13 {
            deep = json!({"type": "complement", "of": deep});
        }
        assert_eq!(parse(&deep).unwrap_err()[0].detail, "shapes are nested too deeply");
        let many = vec![json!({"type": "circle", "radius": 0.5}); 33];
        assert_eq!(parse(&json!({"type": "intersection", "of": many})).unwrap_err()[0].pointer, "/shape/of");
    }

    #[test]
    fn a_transformed_shape_is_rotated_then_scaled_then_moved() {
        let given = json!({"type": "transformed", "of": {"type": "box", "center": [1, 0], "size": [1, 0.5]},
                           "rotate": {"angle": std::f64::consts::FRAC_PI_2}, "scale": 2, "translate": [0, 1]});
        let shape = parse(&given).unwrap();
        let surface = shape.surface::<2>("/shape").unwrap().whole;
        let (low, high) = surface.bounding_box();
        let expected = [[-0.5, 2.0], [0.5, 4.0]];
        assert!(
            (low - Vector::<2>::from(expected[0])).norm() < 1e-14
                && (high - Vector::<2>::from(expected[1])).norm() < 1e-14
        );
        assert_eq!(shape.dimension(), Some(2));
        assert!((surface.area_or_volume() - 2.0).abs() < 1e-14);
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
            Shape::plain(disk).surface::<2>("/shape").err().unwrap().into_iter().map(|error| error.pointer).collect();
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
