//! Motion of the foot-points (GBPM 3.2).

use super::foot_points::FootPoints;
use crate::geometry::frame::{normal_to, tangents};
use crate::geometry::{Flow, Vector};
use crate::parallel::{BLOCK, Interrupt, Interrupted, one_by_one};
use crate::time::PathIntegrator;
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSliceMut};

/// What moves a front.
pub enum Law<const D: usize> {
    /// A prescribed velocity field.
    Flow(Box<dyn Flow<D>>),
    /// A constant speed along the outward normal: along straight lines, on which normals stay as they are.
    Normal {
        /// Positive outward.
        speed: f64,
    },
    /// Velocity −κ n, κ = ∇·n.
    MeanCurvature,
}

impl<const D: usize> Law<D> {
    /// Whether particles stay on the front by themselves, however far apart they come.
    pub(super) fn keeps_particles_exact(&self) -> bool {
        matches!(self, Self::Flow(_))
    }

    /// How far from its particles a place between them may lie, in spacings: a flow opens gaps, elsewhere they are what other
    /// segments have swept.
    pub(super) fn widest_bridge(&self) -> f64 {
        if matches!(self, Self::Flow(_)) { 3.0 } else { 1.5 }
    }

    /// How far the search for the particles of a reconstruction may go, in spacings: by its curvature a surface has no gaps, and what
    /// is left here and there of one that has collapsed must not be joined to sheets. The search grows by factors, and stays below.
    pub(super) fn farthest_search(&self) -> f64 {
        if D == 3 && matches!(self, Self::MeanCurvature) { 4.0 } else { 6.0 }
    }

    /// Whether a particle moves along its normal, 1, or against it, −1.
    pub(super) fn facing(&self, curvature: f64) -> f64 {
        match self {
            Self::Flow(_) => 1.0,
            Self::Normal { speed } => speed.signum(),
            Self::MeanCurvature => -curvature.signum(),
        }
    }

    /// How many particles the quadratic has that takes the place of a wider polynomial in bends which that does not resolve: where
    /// bends go by themselves, the sharper the sooner, a wide one rounds them too slowly.
    #[must_use]
    pub fn particles_in_bends(&self) -> Option<usize> {
        matches!(self, Self::MeanCurvature).then_some(if D == 2 { 6 } else { 16 })
    }

    /// Whether a corner becomes round, seen from a grid point at a distance on the side where it is the closest point:
    /// where it moves towards that side, and always by its curvature.
    pub(super) fn opens_corners(&self, distance: f64) -> bool {
        match self {
            Self::Flow(_) => false,
            Self::Normal { speed } => speed * distance > 0.0,
            Self::MeanCurvature => true,
        }
    }
}

/// Offset of the points by which a tangent is carried along, in spacings.
const OFFSET: f64 = 1e-4;

/// Carries particles and their normals through a flow; returns the longest way in spacings.
///
/// A tangent is the difference of two points close by, and the normal stays across all tangents (a curve in space has its
/// tangent instead): with steps of several spacings the normals of before would tell segments apart no more.
pub(super) fn carry<const D: usize, const M: usize>(
    feet: &mut FootPoints<D>,
    flow: &dyn Flow<D>,
    integrator: PathIntegrator,
    (time, step): (f64, f64),
    spacing: f64,
    interrupt: &Interrupt,
) -> Result<f64, Interrupted> {
    let offset = OFFSET * spacing;
    let blocks = feet.positions.par_chunks_mut(BLOCK).zip(feet.normals.par_chunks_mut(BLOCK));
    let longest = one_by_one(blocks)
        .map(|(positions, normals)| {
            if interrupt.is_raised() {
                return 0.0;
            }
            let mut longest = 0.0_f64;
            for (x, n) in positions.iter_mut().zip(normals) {
                let next = integrator.advance(flow, x, time, step);
                let carried = |t: Vector<D>| integrator.advance(flow, &(*x + t * offset), time, step) - next;
                *n = if D - M == 1 {
                    let frame = tangents::<D, M>(n);
                    let side = normal_to(&frame).dot(n).signum();
                    normal_to(&frame.map(carried)) * side
                } else {
                    carried(*n).normalize()
                };
                longest = longest.max((next - *x).norm_squared());
                *x = next;
            }
            longest
        })
        // A maximum does not depend on the order of its terms.
        .reduce(|| 0.0, f64::max);
    interrupt.check()?;
    Ok(longest.sqrt() / spacing)
}

/// Moves particles along their normals; returns the way in spacings.
pub(super) fn along_normals<const D: usize>(feet: &mut FootPoints<D>, way: f64, spacing: f64) -> f64 {
    for (x, n) in feet.positions.iter_mut().zip(&feet.normals) {
        *x += n * way;
    }
    if feet.is_empty() { 0.0 } else { way.abs() / spacing }
}

/// −κ n.
pub(super) fn curvature_velocity<const D: usize>(curvature: f64, normal: &Vector<D>) -> Vector<D> {
    normal * -curvature
}
