//! Motion by mean curvature.

use super::{FrontAtStart, FrontLaw, MotionStep, MovingFront, StepPlan, staged_motion};
use crate::geometry::Vector;
use crate::schemes::grid_based_particle::curvature_stability::{StabilityPlan, longest_step};
use crate::schemes::grid_based_particle::exact_front::{ExactFrontMotion, ShrinkingBall, UnknownMotion};
use crate::schemes::grid_based_particle::foot_points::FootPoints;
use crate::time::integrators::PathError;

/// The law of mean curvature: the velocity is −κ n with κ = ∇·n.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanCurvature;

/// Default of dt/h²; the longest stable step replaces it where that is shorter.
const DEFAULT_STEP: f64 = 0.5;
/// Length or area relative to the start above which a run counts as unstable: the exact front only shrinks.
const MOST_GROWTH: f64 = 2.0;
/// Particles of the quadratics in sharp bends, in the plane and in space.
const PARTICLES_IN_BENDS: [usize; 2] = [6, 16];
/// Largest radius of the search for particles in space, in spacings. A surface that moves by its curvature has no gaps, and
/// the remains of one that has collapsed must not be joined to other sheets.
const FARTHEST_SEARCH_IN_SPACE: f64 = 4.0;

/// Number of particles of the quadratic in bends of a front that its curvature smooths.
pub(super) fn particles_in_bends<const D: usize>() -> Option<usize> {
    Some(PARTICLES_IN_BENDS[D - 2])
}

/// The velocity −κ n of particle i.
fn velocity<const D: usize>(feet: &FootPoints<D>, i: usize) -> Vector<D> {
    feet.normals[i] * -feet.curvatures[i]
}

impl<const D: usize, const M: usize> FrontLaw<D, M> for MeanCurvature {
    fn name(&self) -> &'static str {
        "mean_curvature"
    }

    fn velocity(&self, feet: &FootPoints<D>, i: usize, _time: f64) -> Vector<D> {
        velocity(feet, i)
    }

    /// Runge–Kutta stages of dy/dt = −κ n, each with curvatures and normals of reconstructions through the particles of the
    /// stage.
    fn advance(&self, front: &mut MovingFront<'_, D>, step: &MotionStep<'_>) -> Result<f64, PathError> {
        staged_motion::advance(front, step, |feet, _, velocities| {
            for (i, slot) in velocities.iter_mut().enumerate() {
                *slot = velocity(feet, i);
            }
            Ok(())
        })
    }

    fn normal_displacement(&self, feet: &FootPoints<D>, i: usize, _time: f64, step: f64) -> f64 {
        -feet.curvatures[i] * step
    }

    fn facing(&self, feet: &FootPoints<D>, i: usize) -> f64 {
        -feet.curvatures[i].signum()
    }

    fn farthest_search(&self) -> f64 {
        if D == 3 { FARTHEST_SEARCH_IN_SPACE } else { 6.0 }
    }

    /// Bends flatten by themselves, the sharper the sooner; a wide polynomial would flatten them too slowly.
    fn particles_in_bends(&self) -> Option<usize> {
        particles_in_bends::<D>()
    }

    fn opens_corners(&self, _signed_distance: f64) -> bool {
        true
    }

    fn rounds_corners_at_once(&self) -> bool {
        true
    }

    fn most_growth(&self) -> Option<f64> {
        Some(MOST_GROWTH)
    }

    fn keeps_fronts_closed(&self) -> bool {
        true
    }

    /// The speed depends on the curvature and has no bound.
    fn top_speed(&self, _extent: Option<&(Vector<D>, Vector<D>)>) -> f64 {
        f64::INFINITY
    }

    fn default_cfl(&self) -> Option<f64> {
        None
    }

    fn default_time_step(&self, plan: &StepPlan<D>) -> f64 {
        DEFAULT_STEP.min(longest_step(&plan.stability)) * plan.finest * plan.finest
    }

    fn longest_step(&self, stability: &StabilityPlan) -> Option<f64> {
        Some(longest_step(stability))
    }

    /// Each stage of a step needs reconstructions through all particles, so they take the same steps.
    fn takes_error_control(&self) -> bool {
        false
    }

    fn exact_motion(&self, start: FrontAtStart<D>) -> Box<dyn ExactFrontMotion<D>> {
        match start.ball {
            Some(start) => Box::new(ShrinkingBall { start }),
            None => Box::new(UnknownMotion),
        }
    }
}
