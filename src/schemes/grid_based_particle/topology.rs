//! Control of topology (GBPM 3.6): where two segments have run through each other, what lies behind the other is removed.
//!
//! The paper removes whatever has a particle of another segment within 2 γ; that takes whole fronts away where segments are merely
//! close. Here something goes when it has just passed: it was in front of the other segment, and is behind it. Behind alone would
//! not do: the two sides of a convex corner or of a thin body lie behind each other, but move apart.

use super::foot_points::FootPoints;
use super::grid::Grid;
use super::method::FrontMethod;
use crate::geometry::Vector;
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::{BLOCK, Interrupt, Interrupted, one_by_one};
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
/// How far along a segment its particle stands for it, in spacings: where segments have met, the nearest may be that far.
const LOCAL: f64 = 2.5;
/// The largest |κ| h that is believed: at a cusp a fit makes up more.
const MOST_BENT: f64 = 0.2;
/// What counts as behind, in spacings.
const BEHIND: f64 = 1e-9;
/// How far behind something may have been that was in front, in spacings and by how far it has moved against the other: tangents and
/// curvatures are not the whole front.
const WAS_BEHIND: [f64; 2] = [0.1, 0.5];
/// Cosine of normals that point at each other.
const FACE_TO_FACE: f64 = -0.9;
/// Normals whose cosine is larger are never those of segments that pass each other, whatever tells segments apart elsewhere.
const NEVER: f64 = 0.5;

/// How far a place lies outside the front at particle j, by its tangent and its mean curvature; None where it is too far along.
pub(super) fn height_over<const D: usize>(
    feet: &FootPoints<D>,
    j: usize,
    place: &Vector<D>,
    spacing: f64,
) -> Option<f64> {
    let d = place - feet.positions[j];
    let height = d.dot(&feet.normals[j]);
    let along = d.norm_squared() - height * height;
    (along <= (LOCAL * spacing).powi(2)).then(|| {
        let bend = (feet.curvatures[j] / (D as f64 - 1.0)).clamp(-MOST_BENT / spacing, MOST_BENT / spacing);
        height + 0.5 * bend * along
    })
}

/// Whether particles belong to segments that may have passed each other.
pub(super) fn may_pass<const D: usize>(feet: &FootPoints<D>, i: usize, j: usize, cosine: f64) -> bool {
    feet.normals[i].dot(&feet.normals[j]) <= cosine.min(NEVER)
}

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
    one_by_one(keep.par_chunks_mut(BLOCK).enumerate()).for_each(|(block, keep)| {
        for (k, keep) in keep.iter_mut().enumerate() {
            if interrupt.is_raised() {
                return;
            }
            let i = block * BLOCK + k;
            let (x, n, spacing) = (&feet.positions[i], &feet.normals[i], grid.spacing_of(feet.nodes[i]));
            let start = x - n * way(i);
            cells.for_each_within(x, REACH * spacing, |j, _, _| {
                if !may_pass(feet, i, j, method.cosine) {
                    return;
                }
                let Some(height) = height_over(feet, j, x, spacing) else { return };
                let (m, facing) = (&feet.normals[j], way(j).signum());
                let ahead = height * facing;
                let moved = (way(j) - way(i) * n.dot(m)) * facing;
                let slack = (WAS_BEHIND[0] * spacing).min(WAS_BEHIND[1] * moved);
                let apart = start - (feet.positions[j] - m * way(j));
                let approach = -apart.dot(&(n * way(i) - m * way(j)));
                // The particles of a fan start from one place; so do those of two segments that touch, face to face.
                let has_touched = n.dot(m) < FACE_TO_FACE && apart.norm() < BEHIND * spacing;
                let was_approaching = has_touched || approach > BEHIND * spacing * spacing;
                if was_approaching && ahead < -BEHIND * spacing && ahead + moved >= -slack {
                    *keep = false;
                }
            });
        }
    });
    interrupt.check()
}
