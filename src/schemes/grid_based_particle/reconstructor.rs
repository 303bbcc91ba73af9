//! Reconstructions at many places, and the storage for them that lasts from step to step.

use super::config::FrontConfig;
use super::foot_points::FootPoints;
use super::grid::Grid;
use super::local_graph::Terms;
use super::reconstruction::{Failure, Outcome, Reconstruction, Workspace};
use crate::geometry::{Domain, Vector};
use crate::neighbors::CellList;
use crate::parallel::{BLOCK, Interrupted, PerThread, one_by_one};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};

/// The particles sorted into cells, and what their reconstructions need.
pub(super) struct Reconstructor<const D: usize, const M: usize> {
    cells: CellList<D>,
    terms: Terms<M>,
    quadratic: Terms<M>,
    workspaces: PerThread<Workspace<D, M>>,
    /// Foot points at the particles themselves, for [`Self::renew_geometry`].
    renewed: Vec<Outcome<D>>,
}

impl<const D: usize, const M: usize> Reconstructor<D, M> {
    /// Storage for reconstructions of a degree.
    pub fn new(degree: usize) -> Self {
        Self {
            cells: CellList::new(Domain::unbounded()),
            terms: Terms::new(degree),
            quadratic: Terms::new(2),
            workspaces: PerThread::new(),
            renewed: Vec::new(),
        }
    }

    /// Sorts the particles into cells.
    pub fn sort(&mut self, feet: &FootPoints<D>, grid: &Grid) {
        let edge = feet.finest_spacing(grid);
        self.cells.rebuild(feet.positions.iter().copied(), edge);
    }

    /// The particles as they were sorted last.
    pub fn cells(&self) -> &CellList<D> {
        &self.cells
    }

    /// Reconstruction through the particles, which must be where they were sorted.
    pub fn reconstruction<'a>(
        &'a self,
        feet: &'a FootPoints<D>,
        config: &'a FrontConfig<D, M>,
    ) -> Reconstruction<'a, D, M> {
        let Self { cells, terms, quadratic, .. } = self;
        Reconstruction { feet, cells, config, terms, quadratic, merges: config.merges() }
    }

    /// Writes the closest point of the front to the place of each item. `place` gives the place and its spacing.
    ///
    /// # Errors
    /// [`Interrupted`] when the run is asked to stop.
    pub fn closest_points<T: Sync>(
        &self,
        reconstruction: &Reconstruction<'_, D, M>,
        items: &[T],
        outcomes: &mut Vec<Outcome<D>>,
        place: impl Fn(usize, &T) -> (Vector<D>, f64) + Sync,
    ) -> Result<(), Interrupted> {
        let interrupt = &reconstruction.config.interrupt;
        outcomes.clear();
        outcomes.resize(items.len(), Err(Failure::Starved));
        let blocks = items.par_chunks(BLOCK).zip(outcomes.par_chunks_mut(BLOCK)).enumerate();
        one_by_one(blocks).for_each(|(block, (items, outcomes))| {
            if interrupt.is_raised() {
                return;
            }
            self.workspaces.with(|workspace| {
                for (k, (item, outcome)) in items.iter().zip(outcomes).enumerate() {
                    let (place, spacing) = place(block * BLOCK + k, item);
                    *outcome = reconstruction.closest(&place, spacing, workspace);
                }
            });
        });
        interrupt.check()
    }

    /// Computes normals and curvatures at the particles where they are. Where a reconstruction fails the last ones stay.
    ///
    /// # Errors
    /// [`Interrupted`] when the run is asked to stop.
    pub fn renew_geometry(&mut self, feet: &mut FootPoints<D>, config: &FrontConfig<D, M>) -> Result<(), Interrupted> {
        self.sort(feet, &config.grid);
        let mut renewed = std::mem::take(&mut self.renewed);
        let place = |i: usize, x: &Vector<D>| (*x, config.grid.spacing_of(feet.nodes[i]));
        let found = self.closest_points(&self.reconstruction(feet, config), &feet.positions, &mut renewed, place);
        self.renewed = renewed;
        found?;
        for (i, outcome) in self.renewed.iter().enumerate() {
            if let Ok(foot) = outcome {
                feet.normals[i] = foot.normal;
                feet.curvatures[i] = foot.curvature;
                feet.gauss_curvatures[i] = foot.gauss_curvature;
            }
        }
        Ok(())
    }
}
