//! The points of a surface and the field on it.

use crate::geometry::Vector;

/// The points of a surface and what is known there.
#[derive(Debug, Clone, Default)]
pub struct SurfaceData {
    /// Positions of the points.
    pub points: Vec<Vector<3>>,
    /// Unit normals at the points.
    pub normals: Vec<Vector<3>>,
    /// Curvature ∇·n at the points.
    pub curvatures: Vec<f64>,
    /// Values of the field at the points.
    pub field: Vec<f64>,
    /// Exact Laplace–Beltrami operator of the field at the points.
    pub reference: Vec<f64>,
}
