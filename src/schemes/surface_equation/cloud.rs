//! The points of a surface and what is known there.

use crate::geometry::Vector;

/// Points with unit normals. The first [`Self::rows`] are unknowns; those behind are images of them across an edge.
#[derive(Debug, Clone, Default)]
pub struct SurfaceCloud<const D: usize> {
    /// Positions of the points; images beyond an edge come last.
    pub points: Vec<Vector<D>>,
    /// Unit normals that the operators are made with.
    pub normals: Vec<Vector<D>>,
    /// Whose value an image takes; empty without images.
    pub source: Vec<u32>,
    /// Supports by that of the method, one a point; empty where all are alike.
    pub scales: Vec<f64>,
    /// Number of unknowns: points without images.
    pub rows: usize,
    /// ∇·n where it is known, else NaN; empty where nothing is known of the surface but its points.
    pub curvatures: Vec<f64>,
    /// Exact Gauss curvature at each unknown, where it is known.
    pub gauss: Vec<f64>,
    /// The share of the surface that each unknown stands for, where it is known.
    pub areas: Option<Vec<f64>>,
    /// Points whose values go into the series.
    pub probes: Vec<usize>,
}

impl<const D: usize> SurfaceCloud<D> {
    /// Σ area f, or the mean where areas are not known.
    #[must_use]
    pub fn integral(&self, field: &[f64]) -> f64 {
        match &self.areas {
            Some(areas) => areas.iter().zip(field).map(|(area, f)| area * f).sum(),
            None => field.iter().sum::<f64>() / field.len().max(1) as f64,
        }
    }
}
