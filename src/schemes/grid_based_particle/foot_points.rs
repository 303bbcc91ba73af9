//! The particles of a front: one foot point for each grid point near it.

use super::grid::{Grid, Node};
use crate::geometry::Vector;
use crate::simulation::section::check_length;
use crate::simulation::{Component, LoadError, Section};

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
    /// Numbers of the grid points.
    pub nodes: Vec<Node>,
    /// Positions y.
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
}

impl<const D: usize> Component for FootPoints<D> {
    fn save(&self, section: &mut Section) {
        section.put_vectors("position", &self.positions);
        section.put_vectors("normal", &self.normals);
        section.put_reals("curvature", &self.curvatures);
        section.put_reals("gauss_curvature", &self.gauss_curvatures);
        section.put_reals("parameter", &self.parameters);
        section.put_counts("grid_point", self.nodes.iter().copied());
        section.put_counts("part", self.parts.iter().map(|part| u64::from(*part)));
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        let nodes = section.counts("grid_point")?.to_vec();
        let n = nodes.len();
        let scalars = |name: &str| Ok::<_, LoadError>(section.reals_of(name, n)?.to_vec());
        let (positions, normals) = (section.vectors("position")?, section.vectors("normal")?);
        check_length("position", positions.len(), n)?;
        check_length("normal", normals.len(), n)?;
        Ok(Self {
            nodes,
            positions,
            normals,
            curvatures: scalars("curvature")?,
            gauss_curvatures: scalars("gauss_curvature")?,
            parameters: scalars("parameter")?,
            parts: section.counts_of("part", n)?.iter().map(|part| *part as u32).collect(),
        })
    }
}
