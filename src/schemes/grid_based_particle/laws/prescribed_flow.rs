//! Motion in a prescribed velocity field (GBPM 3.2).

use super::{FrontAtStart, FrontLaw, MotionStep, MovingFront};
use crate::geometry::flows::Stretch;
use crate::geometry::frame::{normal_to, tangents};
use crate::geometry::{Flow, Vector};
use crate::parallel::{BLOCK, Interrupted, one_by_one};
use crate::schemes::exact_motion::ExactMotion;
use crate::schemes::front_stretch::front_stretch;
use crate::schemes::grid_based_particle::exact_front::ExactFrontMotion;
use crate::schemes::grid_based_particle::foot_points::FootPoints;
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

    fn advance(&self, front: &mut MovingFront<'_, D>, step: &MotionStep<'_>) -> Result<f64, Interrupted> {
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
) -> Result<f64, Interrupted> {
    let &MotionStep { time, step, integrator, spacing, interrupt } = motion;
    let offset = TANGENT_OFFSET * spacing;
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
