//! Analytic surfaces with exact distance, closest point, normal and curvature: what scenes start from and what
//! errors are measured against. One file a shape.
//!
//! Signed distances are positive outside; normals point outward; the curvature is ∇·n (circle 1/R, sphere 2/R).

pub mod ball;
pub mod cuboid;
pub mod dumbbell;
pub mod ellipsoid;
mod profile;
pub mod rounded_cuboid;
pub mod torus;
pub mod union;
pub mod zalesak_disk;

pub use ball::Ball;
pub use cuboid::Cuboid;
pub use dumbbell::Dumbbell;
pub use ellipsoid::Ellipsoid;
pub use rounded_cuboid::RoundedCuboid;
pub use torus::Torus;
pub use union::Union;
pub use zalesak_disk::ZalesakDisk;

use super::Vector;

/// The exact answer of a surface for one query point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint<const D: usize> {
    /// Signed distance, positive outside.
    pub distance: f64,
    /// A closest point; at the medial axis one of several.
    pub point: Vector<D>,
    /// Outward unit normal at the closest point, where the surface has one (not at corners and edges).
    pub normal: Option<Vector<D>>,
    /// ∇·n at the closest point, where it exists.
    pub curvature: Option<f64>,
}

/// A closed surface (curve in 2D) known exactly.
pub trait Surface<const D: usize>: Send + Sync {
    /// Distance, closest point, normal and curvature for a query point, exact to round-off.
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D>;

    /// A box that holds the surface: lower and upper corner.
    fn bounding_box(&self) -> (Vector<D>, Vector<D>);

    /// The enclosed area (2D) or volume (3D).
    fn area_or_volume(&self) -> f64;

    /// Whether `x` lies within `tolerance` of a place with more than one closest point, where normals and
    /// curvatures of a numerical answer may rightly differ from this surface's choice.
    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool;

    /// The curve as chains of points at most `spacing` apart, inside on the left; empty in 3D.
    ///
    /// Consecutive points of a chain are joined; a closed chain repeats its first point at the end.
    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>>;

    /// Signed distance alone.
    fn signed_distance(&self, x: &Vector<D>) -> f64 {
        self.nearest(x).distance
    }
}

/// Points of a circular arc from angle `from` to `to`, both included, at most `spacing` apart.
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

/// Points of a straight line from `a` to `b`, both included, at most `spacing` apart.
pub(crate) fn line_points<const D: usize>(a: &Vector<D>, b: &Vector<D>, spacing: f64) -> Vec<Vector<D>> {
    let count = (((b - a).norm() / spacing).ceil() as usize).max(1);
    (0..=count).map(|k| a + (b - a) * (k as f64 / count as f64)).collect()
}

/// Joins consecutive pieces that share their ends into one chain.
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
