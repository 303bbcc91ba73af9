//! Detection of the particles next to the surface: those with a particle of another side within ξ (PCP 3.1).

use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};

/// The side of the surface on which a particle lies, from the sign of its level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The level is negative.
    Inside,
    /// The level is positive, or no number.
    Outside,
    /// The level is exactly zero: the surface passes through the particle.
    On,
}

impl Side {
    /// The side of a particle with the given level. Both zeros are [`Side::On`].
    #[must_use]
    #[inline(always)]
    pub fn from_level(level: f64) -> Self {
        if level < 0.0 {
            Self::Inside
        } else if level == 0.0 {
            Self::On
        } else {
            Self::Outside
        }
    }

    /// Whether the surface separates particles of two sides. One on the surface belongs to both sides.
    #[must_use]
    #[inline(always)]
    pub fn is_apart_from(self, other: Self) -> bool {
        self != other
    }

    /// The marks of the sides that it belongs to.
    #[inline(always)]
    fn marks(self) -> u8 {
        match self {
            Self::Inside => INSIDE,
            Self::Outside => OUTSIDE,
            Self::On => INSIDE | OUTSIDE,
        }
    }
}

/// Particles sorted into cells of edge ξ, their sides, and the near-surface particles.
#[derive(Debug)]
pub struct Detection<const D: usize> {
    cells: CellList<D>,
    /// Side of each particle.
    sides: Vec<Side>,
    /// `sides` in the order of cells.
    sorted_sides: Vec<Side>,
    /// Sides that occur in each cell and the adjacent ones.
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
            sides: Vec::new(),
            sorted_sides: Vec::new(),
            marks: Vec::new(),
            before: Vec::new(),
            candidates: Vec::new(),
            is_near: Vec::new(),
            near: Vec::new(),
        }
    }

    /// Replaces the domain, before the next detection.
    pub fn set_domain(&mut self, domain: &Domain<D>) {
        self.cells.set_domain(domain);
    }

    /// The cell list of all particles.
    #[must_use]
    pub fn cells(&self) -> &CellList<D> {
        &self.cells
    }

    /// Side of each particle.
    #[must_use]
    pub fn sides(&self) -> &[Side] {
        &self.sides
    }

    /// Indices of the particles next to the surface.
    #[must_use]
    pub fn near(&self) -> &[usize] {
        &self.near
    }

    /// Finds the particles next to the surface. A particle with a level of exactly zero belongs to both sides.
    ///
    /// 1. Sort the particles into cells of edge ξ = `threshold`, and mark each cell with the sides in it and in the
    ///    adjacent cells.
    /// 2. Look for a particle of another side within ξ, only for particles in cells with both marks.
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
        self.sides.clear();
        self.sides.extend(level.iter().map(|level| Side::from_level(*level)));
        let (cells, sides) = (&self.cells, &self.sides);
        let (starts, order) = (cells.starts(), cells.permutation());
        self.sorted_sides.clear();
        self.sorted_sides.extend(order.iter().map(|i| sides[*i]));
        let sides = &self.sorted_sides;
        self.marks.clear();
        self.marks.extend(
            starts.windows(2).map(|range| sides[range[0]..range[1]].iter().fold(0, |all, side| all | side.marks())),
        );
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
                let side = sides[*place];
                *flag = cells.any_within(&sorted[*place], threshold, |other| side.is_apart_from(sides[other]));
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
        self.cells.nearest(x, f64::INFINITY).is_some_and(|(i, _)| self.sides[i] == Side::Inside)
    }
}
