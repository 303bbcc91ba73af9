//! The points of a surface and what is known there.

use crate::geometry::Vector;
use crate::linear_algebra::mean_term::MeanTerm;
use crate::point_clouds::StarGraph;

use super::conservative;
use std::collections::BTreeMap;

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
    /// Local spacing at each point, a length; empty without stars.
    pub spacings: Vec<f64>,
    /// The graph of stars; empty where operators do not need it.
    pub graph: StarGraph,
    /// Triangles of the surface for pictures; empty where they are not known.
    pub triangles: Vec<[u32; 3]>,
    /// The direction out of the surface at points of an edge that nothing flows through; empty where there are none.
    pub conormals: Vec<Option<Vector<D>>>,
    /// With copies beyond edges where the surface repeats.
    pub copies: Option<Copies<D>>,
    /// Points of an edge that hold a value in equations, with the value.
    pub held: Vec<(usize, f64)>,
    /// Values at the unknowns that came from outside, by the place in the scene that takes them.
    pub data: BTreeMap<&'static str, Vec<f64>>,
}

/// Points of a surface that repeats with their copies beyond opposite edges.
#[derive(Debug, Clone, Default)]
pub struct Copies<const D: usize> {
    /// Positions of the points and then of the copies.
    pub points: Vec<Vector<D>>,
    /// Their unit normals.
    pub normals: Vec<Vector<D>>,
    /// Their local spacings.
    pub spacings: Vec<f64>,
    /// Their graph of stars.
    pub graph: StarGraph,
    /// Their conormals at edges that nothing flows through.
    pub conormals: Vec<Option<Vector<D>>>,
    /// The point that each is a copy of.
    pub source: Vec<u32>,
}

impl<const D: usize> SurfaceCloud<D> {
    /// Whether each point holds a value.
    #[must_use]
    pub fn held_mask(&self) -> Vec<bool> {
        let mut mask = vec![false; self.rows];
        self.held.iter().for_each(|(i, _)| mask[*i] = true);
        mask
    }

    /// Areas of the cells that the conservative form exchanges between; without stars those of the surface, where they are known.
    #[must_use]
    pub fn cell_areas(&self) -> Option<&[f64]> {
        if self.graph.is_empty() { self.areas.as_deref() } else { Some(&self.graph.areas) }
    }

    /// What each unknown stands for: its area, or where areas are not known its share of all points.
    #[must_use]
    pub fn weights(&self) -> Vec<f64> {
        match &self.areas {
            Some(areas) => areas[..self.rows].to_vec(),
            None => vec![1.0 / self.rows.max(1) as f64; self.rows],
        }
    }

    /// Σ area f, or the mean where areas are not known.
    #[must_use]
    pub fn integral(&self, field: &[f64]) -> f64 {
        match &self.areas {
            Some(areas) => areas.iter().zip(field).map(|(area, f)| area * f).sum(),
            None => field.iter().sum::<f64>() / field.len().max(1) as f64,
        }
    }

    /// Mean of a field: weighted by the areas of stars where there are stars, else the plain mean over the points.
    #[must_use]
    pub fn mean(&self, field: &[f64]) -> f64 {
        self.mean_by(field, |value| value)
    }

    /// Root mean square of one field, or of several one after another; weighted likewise.
    #[must_use]
    pub fn root_mean_square(&self, fields: &[f64]) -> f64 {
        self.mean_by(fields, |value| value * value).sqrt()
    }

    fn mean_by(&self, fields: &[f64], function: impl Fn(f64) -> f64) -> f64 {
        let values = fields.iter().map(|value| function(*value));
        if self.graph.is_empty() {
            return values.sum::<f64>() / fields.len().max(1) as f64;
        }
        let (sum, whole) = values
            .zip(self.graph.areas.iter().cycle())
            .fold((0.0, 0.0), |(sum, whole), (value, area)| (sum + area * value, whole + area));
        sum / whole
    }

    /// The term of means that makes Δ_S regular: part by part with stars, else with the given factor for all points.
    #[must_use]
    pub fn mean_term(&self, alpha: f64) -> MeanTerm {
        if self.graph.is_empty() {
            MeanTerm::uniform(self.rows, alpha)
        } else {
            conservative::mean_term(&self.graph, D)
        }
    }
}
