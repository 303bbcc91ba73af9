//! Surfaces with exact distance, closest point, normal and curvature, one file per shape: plain shapes, zeros of level functions
//! ([`implicit`]), what solids are composed of ([`solid`]), polygons and meshes.
//!
//! Scenes start from these surfaces, and errors are measured against them. Signed distances are positive outside, and
//! normals point outward. The curvature is ∇·n: 1/R on a circle, 2/R on a sphere.

pub mod ball;
pub mod complement;
pub mod composed;
pub mod cuboid;
mod distance_level;
pub mod dumbbell;
pub mod ellipsoid;
pub mod implicit;
pub mod placed;
pub mod polygon;
mod profile;
pub mod rounded_cuboid;
mod sampled;
pub mod solid;
pub mod solid_surface;
pub mod torus;
pub mod triangle_mesh;
pub mod union;
pub mod wavy_layer;
pub mod zalesak_disk;

pub use ball::Ball;
pub use complement::Complement;
pub use composed::{Composed, EmptySolid};
pub use cuboid::Cuboid;
pub use dumbbell::Dumbbell;
pub use ellipsoid::Ellipsoid;
pub use implicit::{ImplicitError, ImplicitSurface};
pub use placed::{Placed, Placement};
pub use polygon::{Polygon, PolygonError};
pub use rounded_cuboid::RoundedCuboid;
pub use solid::Solid;
pub use solid_surface::SolidError;
pub use torus::Torus;
pub use triangle_mesh::{MeshFault, TriangleMesh};
pub use union::Union;
pub use wavy_layer::WavyLayer;
pub use zalesak_disk::ZalesakDisk;

use super::Vector;
use super::level::LevelFunction;
use std::sync::Arc;

/// Closest point of a surface to a query point, with the geometry there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint<const D: usize> {
    /// Signed distance, positive outside.
    pub distance: f64,
    /// A closest point. On the medial axis it is one of several.
    pub point: Vector<D>,
    /// Outward unit normal at the closest point; None at corners and edges.
    pub normal: Option<Vector<D>>,
    /// Curvature ∇·n at the closest point; None where it does not exist.
    pub curvature: Option<f64>,
}

/// A closed surface in space, or a closed curve in the plane, that is known exactly.
///
/// ```
/// use meniscus::geometry::{Surface, Vector, surfaces::Ball};
///
/// let circle = Ball { center: Vector::<2>::zeros(), radius: 0.5 };
/// let nearest = circle.nearest(&Vector::<2>::new(0.0, 2.0));
/// assert_eq!((nearest.distance, nearest.curvature), (1.5, Some(2.0)));
/// ```
pub trait Surface<const D: usize>: Send + Sync {
    /// Signed distance, closest point, normal and curvature for the query point `x`, exact to round-off.
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D>;

    /// Lower and upper corner of a box that contains the surface.
    fn bounding_box(&self) -> (Vector<D>, Vector<D>);

    /// The enclosed area (2D) or volume (3D).
    fn area_or_volume(&self) -> f64;

    /// Whether `x` lies within the distance `tolerance` of the medial axis.
    ///
    /// There a numerical method may find another of the closest points, with another normal and curvature.
    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool;

    /// The curve as chains of points at most `spacing` apart, with the inside on the left; empty in 3D.
    ///
    /// Consecutive points of a chain are joined. A closed chain repeats its first point at the end.
    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>>;

    /// Signed distance of `x`, positive outside.
    fn signed_distance(&self, x: &Vector<D>) -> f64 {
        self.nearest(x).distance
    }

    /// Smooth level functions, negative inside, whose zeros together contain the surface. None where the surface is smooth
    /// itself, so that its distance is one.
    fn faces(&self) -> Option<Vec<Arc<dyn LevelFunction<D>>>> {
        None
    }
}

/// A surface that several owners share.
impl<const D: usize> Surface<D> for Arc<dyn Surface<D>> {
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D> {
        self.as_ref().nearest(x)
    }

    fn bounding_box(&self) -> (Vector<D>, Vector<D>) {
        self.as_ref().bounding_box()
    }

    fn area_or_volume(&self) -> f64 {
        self.as_ref().area_or_volume()
    }

    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool {
        self.as_ref().near_medial_axis(x, tolerance)
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        self.as_ref().outline(spacing)
    }

    fn signed_distance(&self, x: &Vector<D>) -> f64 {
        self.as_ref().signed_distance(x)
    }

    fn faces(&self) -> Option<Vec<Arc<dyn LevelFunction<D>>>> {
        self.as_ref().faces()
    }
}

/// Points at most `spacing` apart on an elliptic arc with the given semi-axes, from the angle `from` to the angle `to`
/// (rad), both included.
pub(crate) fn arc_points<const D: usize>(
    center: &Vector<D>,
    semi_axes: [f64; 2],
    from: f64,
    to: f64,
    spacing: f64,
) -> Vec<Vector<D>> {
    let largest = semi_axes[0].max(semi_axes[1]);
    let count = (((to - from).abs() * largest / spacing).ceil() as usize).max(8);
    (0..=count)
        .map(|k| {
            let angle = from + (to - from) * k as f64 / count as f64;
            let mut x = *center;
            x[0] += semi_axes[0] * angle.cos();
            x[1] += semi_axes[1] * angle.sin();
            x
        })
        .collect()
}

/// Points at most `spacing` apart on the straight line from `a` to `b`, both included.
pub(crate) fn line_points<const D: usize>(a: &Vector<D>, b: &Vector<D>, spacing: f64) -> Vec<Vector<D>> {
    let count = (((b - a).norm() / spacing).ceil() as usize).max(1);
    (0..=count).map(|k| a + (b - a) * (k as f64 / count as f64)).collect()
}

/// Joins pieces, each of which starts at the end of the one before, into one chain.
pub(crate) fn join<const D: usize>(pieces: Vec<Vec<Vector<D>>>) -> Vec<Vector<D>> {
    let mut chain: Vec<Vector<D>> = Vec::new();
    for piece in pieces {
        let skip = usize::from(!chain.is_empty());
        chain.extend(piece.into_iter().skip(skip));
    }
    chain
}

#[cfg(test)]
mod tests;
