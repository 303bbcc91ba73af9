//! Configuration of a front.

use super::grid::Grid;
use super::laws::FrontLaw;
use super::method::FrontMethod;
use super::segments::Segments;
use super::topology::Topology;
use crate::parallel::Interrupt;
use crate::time::PathIntegrator;
use std::sync::Arc;

/// Everything that a front in D dimensions depends on beside its foot points; M dimensions lie along it.
#[derive(Clone)]
pub struct FrontConfig<const D: usize, const M: usize> {
    /// The underlying grid.
    pub grid: Grid,
    /// Parameters of the reconstructions and of the tube.
    pub method: FrontMethod,
    /// The law that moves the front.
    pub law: Arc<dyn FrontLaw<D, M>>,
    /// Integrator of paths in a flow and of motion by curvature.
    pub integrator: PathIntegrator,
    /// What happens where segments meet.
    pub topology: Topology,
    /// How segments are told apart beside their normals.
    pub segments: Segments,
    /// Asks a running step to be dropped.
    pub interrupt: Interrupt,
}

impl<const D: usize, const M: usize> FrontConfig<D, M> {
    /// Whether segments that run into each other end there.
    #[must_use]
    pub fn merges(&self) -> bool {
        self.topology == Topology::Merge && self.law.lets_segments_meet()
    }

    /// h of the finest level.
    #[must_use]
    pub fn finest_spacing(&self) -> f64 {
        self.grid.spacing_at(self.method.levels() - 1)
    }
}
