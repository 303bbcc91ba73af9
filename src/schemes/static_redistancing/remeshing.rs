//! The baseline without PCP: particle values are interpolated to the nodes of a Cartesian grid first (PCP appendix A),
//! and closest points are found on the grid (Saye 2014, Taylor polynomials of degree 4).

use crate::closest_point::PcpMethod;
use crate::closest_point::method::NeighborhoodChoice;
use crate::geometry::lattice::Lattice;
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted};
use crate::polynomials::{BasisKind, Solver};
use crate::smoothing_kernels::{Gaussian, Lambda44, SmoothingKernel, WendlandC2};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};

/// How values get to the nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RemeshingKernel {
    /// Σ φ Λ (A.1).
    Lambda44,
    /// Σ φ Λ / Σ Λ (A.2).
    Lambda44Normalized,
    /// Σ φ W V / Σ W V with Wendland's kernel (A.5, A.6).
    WendlandC2 {
        /// Smoothing length ε in h.
        smoothing_h: f64,
    },
    /// The same with the Gaussian (A.5, A.7).
    Gaussian {
        /// Smoothing length ε in h.
        smoothing_h: f64,
    },
}

impl RemeshingKernel {
    fn kernel<const D: usize>(self, spacing: f64) -> Box<dyn SmoothingKernel<D>> {
        match self {
            Self::Lambda44 | Self::Lambda44Normalized => Box::new(Lambda44 { spacing }),
            Self::WendlandC2 { smoothing_h } => Box::new(WendlandC2 { smoothing_length: smoothing_h * spacing }),
            Self::Gaussian { smoothing_h } => Box::new(Gaussian { smoothing_length: smoothing_h * spacing }),
        }
    }

    /// How far values are carried, in multiples of h.
    #[must_use]
    pub fn reach_h<const D: usize>(self) -> f64 {
        self.kernel::<D>(1.0).support()
    }

    /// Whether contributions are weighted by the particles' volumes, and whether they are divided by their sum.
    fn weighting(self) -> (bool, bool) {
        match self {
            Self::Lambda44 => (false, false),
            Self::Lambda44Normalized => (false, true),
            Self::WendlandC2 { .. } | Self::Gaussian { .. } => (true, true),
        }
    }
}

/// Taylor polynomials on a grid: unweighted fits over the nodes of a disk or ball.
#[must_use]
pub fn grid_method() -> PcpMethod {
    PcpMethod {
        degree: 4,
        basis: BasisKind::Monomial,
        neighborhood: NeighborhoodChoice::Radius { cutoff_h: 2.5 },
        solver: Solver::Moments,
        same_branch: false,
        weight: 0.0,
        minimum_ratio: 1.0,
        sample_threshold_h: 1.5,
        tolerance: 1e-14,
        max_iterations: 1000,
    }
}

/// The nodes of the grid and the interpolation to them.
pub struct Remeshing<const D: usize> {
    weighting: (bool, bool),
    kernel: Box<dyn SmoothingKernel<D>>,
    spacing: f64,
    nodes: Vec<Vector<D>>,
    values: Vec<f64>,
    volumes: Vec<f64>,
    cells: CellList<D>,
}

impl<const D: usize> Remeshing<D> {
    /// Nodes at multiples of h within `reach` of a surface given by its distance, in the box `[low, high]`.
    #[must_use]
    pub fn new(
        kernel: RemeshingKernel,
        spacing: f64,
        (low, high): (&Vector<D>, &Vector<D>),
        reach: f64,
        distance: impl Fn(&Vector<D>) -> f64,
        interrupt: &Interrupt,
    ) -> Self {
        let grid = Lattice { spacing, offset: 0.0, jitter: 0.0, seed: 0 };
        let nodes = grid.points_near(low, high, reach, distance, interrupt);
        let values = vec![0.0; nodes.len()];
        let cells = CellList::new(Domain::unbounded());
        let (weighting, kernel) = (kernel.weighting(), kernel.kernel::<D>(spacing));
        Self { weighting, kernel, spacing, nodes, values, volumes: Vec::new(), cells }
    }

    /// Nodes of the grid near the surface.
    #[must_use]
    pub fn nodes(&self) -> &[Vector<D>] {
        &self.nodes
    }

    /// Values at the nodes.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Takes over values of an earlier part of the same run.
    pub fn restore(&mut self, values: &[f64]) {
        self.values.copy_from_slice(values);
    }

    /// Interpolates the particles' level to the nodes.
    ///
    /// # Errors
    /// [`Interrupted`] when a stop was requested.
    pub fn interpolate(
        &mut self,
        positions: &[Vector<D>],
        level: &[f64],
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        let kernel = &self.kernel;
        let (by_volume, is_normalized) = self.weighting;
        let support = kernel.support();
        self.cells.rebuild(positions.iter().copied(), support);
        let cells = &self.cells;
        self.volumes.clear();
        // Plain sums stand for particles of volume h^D.
        self.volumes.resize(positions.len(), self.spacing.powi(D as i32));
        if by_volume {
            self.volumes.par_chunks_mut(BLOCK).zip(positions.par_chunks(BLOCK)).for_each(|(volumes, positions)| {
                if interrupt.is_raised() {
                    return;
                }
                for (volume, x) in volumes.iter_mut().zip(positions) {
                    let mut sum = 0.0;
                    cells.for_each_within(x, support, |_, dx, _| sum += kernel.value(dx));
                    *volume = 1.0 / sum;
                }
            });
        }
        let volumes = &self.volumes;
        self.values.par_chunks_mut(BLOCK).zip(self.nodes.par_chunks(BLOCK)).for_each(|(values, nodes)| {
            if interrupt.is_raised() {
                return;
            }
            for (value, node) in values.iter_mut().zip(nodes) {
                let (mut sum, mut weights) = (0.0, 0.0);
                cells.for_each_within(node, support, |j, dx, _| {
                    let weight = kernel.value(dx) * volumes[j];
                    sum += weight * level[j];
                    weights += weight;
                });
                *value = if is_normalized { sum / weights } else { sum };
            }
        });
        interrupt.check()
    }
}
