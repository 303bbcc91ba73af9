//! Detection of the particles next to the surface: those with a particle of the opposite sign within ξ (PCP 3.1).

use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};

/// Particles sorted into cells of edge ξ, their signs, and the near-surface particles.
#[derive(Debug)]
pub struct Detection<const D: usize> {
    cells: CellList<D>,
    /// Whether each particle has a negative level.
    is_inside: Vec<bool>,
    /// `is_inside` in the order of cells.
    signs: Vec<bool>,
    /// Signs that occur in each cell and the adjacent ones.
    marks: Vec<u8>,
    /// Scratch buffer for the marks.
    before: Vec<u8>,
    /// Slots in cell order of the particles whose cell has both marks.
    candidates: Vec<usize>,
    /// Whether each candidate lies next to the surface.
    is_near: Vec<bool>,
    /// Indices of the near-surface particles, in the order of cells.
    near: Vec<usize>,
}

/// Mark of a cell with a particle of negative level in it or in an adjacent cell.
const INSIDE: u8 = 1;
/// Mark of a cell with a particle of another level in it or in an adjacent cell.
const OUTSIDE: u8 = 2;

impl<const D: usize> Detection<D> {
    /// A detection without particles.
    #[must_use]
    pub fn new(domain: Domain<D>) -> Self {
        Self {
            cells: CellList::new(domain),
            is_inside: Vec::new(),
            signs: Vec::new(),
            marks: Vec::new(),
            before: Vec::new(),
            candidates: Vec::new(),
            is_near: Vec::new(),
            near: Vec::new(),
        }
    }

    /// The cell list of all particles.
    #[must_use]
    pub fn cells(&self) -> &CellList<D> {
        &self.cells
    }

    /// Whether the level of each particle is negative.
    #[must_use]
    pub fn is_inside(&self) -> &[bool] {
        &self.is_inside
    }

    /// Indices of the particles next to the surface.
    #[must_use]
    pub fn near(&self) -> &[usize] {
        &self.near
    }

    /// Finds the particles next to the surface. A level of exactly zero counts as outside.
    ///
    /// 1. Sort the particles into cells of edge ξ = `threshold`, and mark each cell with the signs in it and in the
    ///    adjacent cells.
    /// 2. Look for a particle of the opposite sign within ξ, only for particles in cells with both marks.
    ///
    /// # Errors
    /// [`Interrupted`] when the interrupt is raised.
    pub fn rebuild(
        &mut self,
        positions: &[Vector<D>],
        level: &[f64],
        threshold: f64,
        interrupt: &Interrupt,
    ) -> Result<(), Interrupted> {
        self.cells.rebuild(positions.iter().copied(), threshold);
        self.is_inside.clear();
        self.is_inside.extend(level.iter().map(|l| *l < 0.0));
        let (cells, is_inside) = (&self.cells, &self.is_inside);
        let (starts, order) = (cells.starts(), cells.permutation());
        self.signs.clear();
        self.signs.extend(order.iter().map(|i| is_inside[*i]));
        let signs = &self.signs;
        self.marks.clear();
        self.marks.extend(starts.windows(2).map(|range| {
            let mark = |inside: &bool| if *inside { INSIDE } else { OUTSIDE };
            signs[range[0]..range[1]].iter().map(mark).fold(0, |all, mark| all | mark)
        }));
        cells.spread_marks(&mut self.marks, &mut self.before);
        self.candidates.clear();
        for (cell, mark) in self.marks.iter().enumerate() {
            if *mark == INSIDE | OUTSIDE {
                self.candidates.extend(starts[cell]..starts[cell + 1]);
            }
        }
        self.is_near.resize(self.candidates.len(), false);
        let sorted = cells.sorted();
        self.is_near.par_chunks_mut(BLOCK).zip(self.candidates.par_chunks(BLOCK)).for_each(|(flags, places)| {
            if interrupt.is_raised() {
                return;
            }
            for (flag, place) in flags.iter_mut().zip(places) {
                let inside = signs[*place];
                *flag = cells.any_within(&sorted[*place], threshold, |other| signs[other] != inside);
            }
        });
        interrupt.check()?;
        self.near.clear();
        let found = self.candidates.iter().zip(&self.is_near).filter(|(_, near)| **near);
        self.near.extend(found.map(|(place, _)| order[*place]));
        Ok(())
    }

    /// Whether the particle nearest to `x` has a negative level. This tells the side of a point away from the surface,
    /// also where the surface has gaps.
    #[must_use]
    pub fn is_nearest_inside(&self, x: &Vector<D>) -> bool {
        self.cells.nearest(x, f64::INFINITY).is_some_and(|(i, _)| self.is_inside[i])
    }
}
