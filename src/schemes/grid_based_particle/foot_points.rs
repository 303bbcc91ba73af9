//! The particles of a front: one foot-point a grid point.

use super::grid::{Grid, Node};
use crate::geometry::Vector;
use crate::simulation::state::check_length;
use crate::simulation::{RestoreError, State};

/// One foot-point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootPoint<const D: usize> {
    /// y.
    pub position: Vector<D>,
    /// n, outward; of a curve in space its tangent.
    pub normal: Vector<D>,
    /// ∇·n.
    pub curvature: f64,
    /// Product of the principal curvatures; zero in the plane.
    pub gauss_curvature: f64,
    /// Which of the closed parts of the front at the start it belongs to.
    pub part: u32,
    /// How far along that part, from 0 to 1 round it; 0 where nothing asks for it.
    pub parameter: f64,
}

/// All foot-points, in the order of their grid points; at the start and where moved ones stay others follow.
#[derive(Debug, Clone, Default)]
pub struct FootPoints<const D: usize> {
    /// p.
    pub nodes: Vec<Node>,
    /// y.
    pub positions: Vec<Vector<D>>,
    /// n.
    pub normals: Vec<Vector<D>>,
    /// ∇·n.
    pub curvatures: Vec<f64>,
    /// Product of the principal curvatures.
    pub gauss_curvatures: Vec<f64>,
    /// Part of the front at the start.
    pub parts: Vec<u32>,
    /// How far along it.
    pub parameters: Vec<f64>,
}

impl<const D: usize> FootPoints<D> {
    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// The spacing of the finest level that any is of.
    pub(super) fn finest_spacing(&self, grid: &Grid) -> f64 {
        grid.spacing_at(self.nodes.iter().map(|node| Grid::level(*node)).max().unwrap_or(0))
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.positions.clear();
        self.normals.clear();
        self.curvatures.clear();
        self.gauss_curvatures.clear();
        self.parts.clear();
        self.parameters.clear();
    }

    /// Adds one.
    pub fn push(&mut self, node: Node, foot: &FootPoint<D>) {
        self.nodes.push(node);
        self.positions.push(foot.position);
        self.normals.push(foot.normal);
        self.curvatures.push(foot.curvature);
        self.gauss_curvatures.push(foot.gauss_curvature);
        self.parts.push(foot.part);
        self.parameters.push(foot.parameter);
    }

    /// One of them.
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

    /// Keeps those with a mark, in their order.
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
