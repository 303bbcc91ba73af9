//! The particles of a front: one foot point for each grid point near it.

use super::grid::{Grid, Node};
use crate::geometry::Vector;
use crate::simulation::state::check_length;
use crate::simulation::{RestoreError, State};

/// One foot point: the point of the front closest to a grid point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootPoint<const D: usize> {
    /// y, its position.
    pub position: Vector<D>,
    /// n, the outward unit normal of a surface or the unit tangent of a curve in space.
    pub normal: Vector<D>,
    /// ∇·n, or κ of a curve in space.
    pub curvature: f64,
    /// Product of the principal curvatures; zero of a curve.
    pub gauss_curvature: f64,
    /// Index of its closed part of the front at the start.
    pub part: u32,
    /// Position along that part, from 0 to 1 around it; 0 where parameters are not used.
    pub parameter: f64,
}

/// All foot points in the order of their grid points. Particles of corners, and moved particles that stay, follow.
#[derive(Debug, Clone, Default)]
pub struct FootPoints<const D: usize> {
    /// Grid points.
    pub nodes: Vec<Node>,
    /// Positions.
    pub positions: Vec<Vector<D>>,
    /// Unit normals, or tangents of a curve in space.
    pub normals: Vec<Vector<D>>,
    /// ∇·n, or κ of a curve in space.
    pub curvatures: Vec<f64>,
    /// Products of the principal curvatures.
    pub gauss_curvatures: Vec<f64>,
    /// Indices of closed parts of the front at the start.
    pub parts: Vec<u32>,
    /// Positions along these parts.
    pub parameters: Vec<f64>,
}

impl<const D: usize> FootPoints<D> {
    /// Number of foot points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// The spacing of the finest level with foot points.
    pub(super) fn finest_spacing(&self, grid: &Grid) -> f64 {
        grid.spacing_at(self.nodes.iter().map(|node| Grid::level(*node)).max().unwrap_or(0))
    }

    /// Whether there are no foot points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Removes all foot points.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.positions.clear();
        self.normals.clear();
        self.curvatures.clear();
        self.gauss_curvatures.clear();
        self.parts.clear();
        self.parameters.clear();
    }

    /// Adds a foot point of a grid point.
    pub fn push(&mut self, node: Node, foot: &FootPoint<D>) {
        self.nodes.push(node);
        self.positions.push(foot.position);
        self.normals.push(foot.normal);
        self.curvatures.push(foot.curvature);
        self.gauss_curvatures.push(foot.gauss_curvature);
        self.parts.push(foot.part);
        self.parameters.push(foot.parameter);
    }

    /// Foot point i.
    #[must_use]
    pub fn get(&self, i: usize) -> FootPoint<D> {
        FootPoint {
            position: self.positions[i],
            normal: self.normals[i],
            curvature: self.curvatures[i],
            gauss_curvature: self.gauss_curvatures[i],
            part: self.parts[i],
            parameter: self.parameters[i],
        }
    }

    /// Keeps the marked foot points in their order.
    pub fn retain(&mut self, keep: &[bool]) {
        fn thin<T>(values: &mut Vec<T>, keep: &[bool]) {
            let mut k = 0;
            values.retain(|_| {
                k += 1;
                keep[k - 1]
            });
        }
        thin(&mut self.nodes, keep);
        thin(&mut self.positions, keep);
        thin(&mut self.normals, keep);
        thin(&mut self.curvatures, keep);
        thin(&mut self.gauss_curvatures, keep);
        thin(&mut self.parts, keep);
        thin(&mut self.parameters, keep);
    }

    /// Adds all columns to a state.
    pub fn save(&self, state: &mut State) {
        state.push_vectors("position", &self.positions);
        state.push_vectors("normal", &self.normals);
        state.push_reals("curvature", &self.curvatures);
        state.push_reals("gauss_curvature", &self.gauss_curvatures);
        state.push_reals("parameter", &self.parameters);
        state.push_counts("grid_point", self.nodes.clone());
        state.push_counts("part", self.parts.iter().map(|part| u64::from(*part)).collect());
    }

    /// The columns of a state.
    ///
    /// # Errors
    /// [`RestoreError`] where one is missing or they differ in length.
    pub fn load(state: &State) -> Result<Self, RestoreError> {
        let vectors = |name: &str| -> Result<Vec<Vector<D>>, RestoreError> {
            Ok(state.reals(name)?.chunks_exact(D).map(Vector::<D>::from_column_slice).collect())
        };
        let nodes = state.counts("grid_point")?.to_vec();
        let n = nodes.len();
        let scalars = ["curvature", "gauss_curvature", "parameter"].map(|name| (name, 1));
        for (name, components) in [("position", D), ("normal", D)].into_iter().chain(scalars) {
            check_length(name, state.reals(name)?.len(), n * components)?;
        }
        check_length("part", state.counts("part")?.len(), n)?;
        Ok(Self {
            nodes,
            positions: vectors("position")?,
            normals: vectors("normal")?,
            curvatures: state.reals("curvature")?.to_vec(),
            gauss_curvatures: state.reals("gauss_curvature")?.to_vec(),
            parameters: state.reals("parameter")?.to_vec(),
            parts: state.counts("part")?.iter().map(|part| *part as u32).collect(),
        })
    }
}
