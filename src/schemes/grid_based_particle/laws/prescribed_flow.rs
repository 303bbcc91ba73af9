//! Motion in a prescribed velocity field (GBPM 3.2).

use super::{FrontAtStart, FrontLaw, MotionStep, MovingFront};
use crate::geometry::flows::Stretch;
use crate::geometry::frame::{normal_to, tangents};
use crate::geometry::{Flow, Vector};
use crate::parallel::one_by_one;
use crate::schemes::exact_motion::ExactMotion;
use crate::schemes::front_stretch::front_stretch;
use crate::schemes::grid_based_particle::exact_front::ExactFrontMotion;
use crate::schemes::grid_based_particle::foot_points::FootPoints;
use crate::time::integrators::{PATHS, PathError, longer};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSliceMut};
use std::sync::Arc;

/// The law of a prescribed velocity field: each particle moves with u(x, t).
#[derive(Clone)]
pub struct PrescribedFlow<const D: usize> {
    flow: Arc<dyn Flow<D>>,
}

/// Default CFL number, dt · top speed/h.
const DEFAULT_CFL: f64 = 10.0;
/// Largest distance from a particle to a reconstructed place between particles, in spacings: a flow draws particles apart.
pub(super) const WIDEST_BRIDGE: f64 = 3.0;
/// Offset of the points by which a tangent is carried along, in spacings.
const TANGENT_OFFSET: f64 = 1e-4;

impl<const D: usize> PrescribedFlow<D> {
    /// The law that moves particles with `flow`.
    #[must_use]
    pub fn new(flow: Arc<dyn Flow<D>>) -> Self {
        Self { flow }
    }
}

impl<const D: usize, const M: usize> FrontLaw<D, M> for PrescribedFlow<D> {
    fn name(&self) -> &'static str {
        "flow"
    }

    fn velocity(&self, feet: &FootPoints<D>, i: usize, time: f64) -> Vector<D> {
        self.flow.velocity(&feet.positions[i], time)
    }

    fn advance(&self, front: &mut MovingFront<'_, D>, step: &MotionStep<'_>) -> Result<f64, PathError> {
        carry::<D, M>(front.feet, self.flow.as_ref(), step)
    }

    fn flow(&self) -> Option<&dyn Flow<D>> {
        Some(self.flow.as_ref())
    }

    fn keeps_particles_exact(&self) -> bool {
        true
    }

    /// Paths of a flow never cross.
    fn lets_segments_meet(&self) -> bool {
        false
    }

    fn widest_bridge(&self) -> f64 {
        WIDEST_BRIDGE
    }

    fn top_speed(&self, extent: Option<&(Vector<D>, Vector<D>)>) -> f64 {
        extent.map_or(0.0, |(low, high)| self.flow.top_speed(low, high))
    }

    fn default_cfl(&self) -> Option<f64> {
        Some(DEFAULT_CFL)
    }

    fn stretch(&self, start: &FrontAtStart<D>, end_time: f64) -> Stretch {
        let measured = || front_stretch(start.surface.as_ref(), self.flow.as_ref(), end_time);
        self.flow.typical_stretch().unwrap_or_else(measured)
    }

    fn exact_motion(&self, start: FrontAtStart<D>) -> Box<dyn ExactFrontMotion<D>> {
        Box::new(ExactMotion::new(Some(start.surface), Arc::clone(&self.flow)))
    }
}

/// Carries particles and their normals through a flow. Returns the longest displacement in spacings.
///
/// A tangent is the difference of two points close to each other, and the normal stays perpendicular to all tangents (a curve
/// in space has its tangent instead). Normals of the previous step would not do: after steps of several spacings they no
/// longer tell segments apart.
pub(super) fn carry<const D: usize, const M: usize>(
    feet: &mut FootPoints<D>,
    flow: &dyn Flow<D>,
    motion: &MotionStep<'_>,
) -> Result<f64, PathError> {
    let &MotionStep { time, step, integrator, spacing, interrupt } = motion;
    let offset = TANGENT_OFFSET * spacing;
    let blocks = feet.positions.par_chunks_mut(PATHS).zip(feet.normals.par_chunks_mut(PATHS));
    let longest = one_by_one(blocks)
        .map(|(positions, normals)| {
            let count = positions.len();
            let starts = tangents_of::<D, M>(normals);
            // The other ends of the tangents, one lot for each of them.
            let mut ends = [[Vector::<D>::zeros(); PATHS]; 2];
            for (k, ends) in ends.iter_mut().enumerate().take(lots::<D, M>()) {
                for (i, end) in ends[..count].iter_mut().enumerate() {
                    *end = positions[i] + starts[k][i] * offset;
                }
                integrator.advance_all(flow, &mut ends[..count], time, step);
            }
            let longest = integrator.carry(flow, positions, time, step, interrupt)?;
            for (i, n) in normals.iter_mut().enumerate() {
                *n = if D - M == 1 {
                    let frame = tangents::<D, M>(n);
                    let side = normal_to(&frame).dot(n).signum();
                    let mut k = 0;
                    let carried = frame.map(|_| {
                        k += 1;
                        ends[k - 1][i] - positions[i]
                    });
                    normal_to(&carried) * side
                } else {
                    (ends[0][i] - positions[i]).normalize()
                };
            }
            Ok(longest)
        })
        .reduce(|| Ok(0.0), longer)?;
    Ok(longest / spacing)
}

/// Number of directions that are carried along: tangents of a surface, or the tangent that a curve in space has as its normal.
const fn lots<const D: usize, const M: usize>() -> usize {
    if D - M == 1 { M } else { 1 }
}

/// The directions that are carried along, by direction and particle.
fn tangents_of<const D: usize, const M: usize>(normals: &[Vector<D>]) -> [[Vector<D>; PATHS]; 2] {
    let mut directions = [[Vector::<D>::zeros(); PATHS]; 2];
    for (i, n) in normals.iter().enumerate() {
        if D - M == 1 {
            for (k, tangent) in tangents::<D, M>(n).into_iter().enumerate() {
                directions[k][i] = tangent;
            }
        } else {
            directions[0][i] = *n;
        }
    }
    directions
}
