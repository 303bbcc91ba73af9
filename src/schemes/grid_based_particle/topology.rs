//! Control of topology (GBPM 3.6): where two segments have run through each other, what lies behind the other is removed.
//!
//! The paper removes whatever has a particle of another segment within 2 γ; that takes whole fronts away where segments are merely
//! close. Here a particle goes when the nearest particle of another segment has just passed it: it lies behind that one by no
//! more than both have moved in the step.

use super::foot_points::FootPoints;
use super::grid::Grid;
use super::method::FrontMethod;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSliceMut};

/// What happens where two segments of a front meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Topology {
    /// They merge: the viscosity solution.
    Merge,
    /// They pass through each other.
    Cross,
}

/// How far away the other segment is looked for, in spacings.
const REACH: f64 = 3.0;
/// How much deeper than it has moved a particle may lie behind another segment, in spacings.
const SLACK: f64 = 0.6;
/// What counts as behind, in spacings.
const BEHIND: f64 = 1e-9;

/// Marks the particles that another segment has not swept. `way(i)` is how far particle i has moved along its normal in
/// the step, in lengths.
pub(super) fn mark_unswept<const D: usize>(
    feet: &FootPoints<D>,
    cells: &CellList<D>,
    (method, grid): (&FrontMethod, &Grid),
    way: &(impl Fn(usize) -> f64 + Sync),
    keep: &mut Vec<bool>,
    interrupt: &Interrupt,
) -> Result<(), Interrupted> {
    keep.clear();
    keep.resize(feet.len(), true);
    keep.par_chunks_mut(BLOCK).enumerate().for_each(|(block, keep)| {
        for (k, keep) in keep.iter_mut().enumerate() {
            if interrupt.is_raised() {
                return;
            }
            let i = block * BLOCK + k;
            let (x, n, spacing) = (&feet.positions[i], &feet.normals[i], grid.spacing_of(feet.nodes[i]));
            let mut nearest: Option<(f64, usize)> = None;
            cells.for_each_within(x, REACH * spacing, |j, _, r2| {
                if feet.normals[j].dot(n) <= method.cosine && nearest.is_none_or(|best| (r2, j) < best) {
                    nearest = Some((r2, j));
                }
            });
            if let Some((_, j)) = nearest {
                let m = &feet.normals[j];
                let depth = -(x - feet.positions[j]).dot(m) * way(j).signum();
                let moved = (way(j) - way(i) * n.dot(m)) * way(j).signum();
                *keep = depth <= BEHIND * spacing || depth > moved.max(0.0) + SLACK * spacing;
            }
        }
    });
    interrupt.check()
}
