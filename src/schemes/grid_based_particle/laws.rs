//! The laws that move a front. One file a law.

mod formula_speed;
mod geometrical_optics;
mod mean_curvature;
mod normal_speed;
mod prescribed_flow;
mod staged_motion;

pub use formula_speed::FormulaSpeed;
pub use geometrical_optics::GeometricalOptics;
pub use mean_curvature::MeanCurvature;
pub use normal_speed::NormalSpeed;
pub use prescribed_flow::PrescribedFlow;

use super::curvature_stability::StabilityPlan;
use super::exact_front::{ExactFrontMotion, UnknownMotion};
use super::foot_points::FootPoints;
use super::topology::Topology;
use crate::geometry::flows::Stretch;
use crate::geometry::surfaces::Ball;
use crate::geometry::{Flow, Surface, Vector};
use crate::parallel::{Interrupt, Interrupted};
use crate::time::PathIntegrator;
use crate::time::integrators::PathError;

/// A law that moves a front of M dimensions in a space of D dimensions.
///
/// A law answers all questions about itself, so no other code needs to know which law it is. Methods with a default state
/// what holds for most laws.
pub trait FrontLaw<const D: usize, const M: usize>: Send + Sync {
    /// Name of the law where costs of similar runs are compared.
    fn name(&self) -> &'static str;

    // Motion.

    /// Velocity of particle `i` at `time`.
    fn velocity(&self, feet: &FootPoints<D>, i: usize, time: f64) -> Vector<D>;

    /// Moves all particles through one step. Returns the longest displacement in spacings of the finest level.
    ///
    /// # Errors
    /// [`PathError`]: the run is asked to stop, or what moves the front is not defined at a particle.
    fn advance(&self, front: &mut MovingFront<'_, D>, step: &MotionStep<'_>) -> Result<f64, PathError>;

    /// Displacement of particle `i` along its normal in one step that starts at `time`, as far as the front determines it.
    fn normal_displacement(&self, _feet: &FootPoints<D>, _i: usize, _time: f64, _step: f64) -> f64 {
        0.0
    }

    /// Direction in which particle `i` moves: 1 along its normal, −1 against it.
    fn facing(&self, _feet: &FootPoints<D>, _i: usize) -> f64 {
        1.0
    }

    /// The velocity field, where one is prescribed.
    fn flow(&self) -> Option<&dyn Flow<D>> {
        None
    }

    // What reconstructions and resampling may assume.

    /// Whether particles stay on the exact front however far apart they come.
    fn keeps_particles_exact(&self) -> bool {
        false
    }

    /// Whether two segments of the front can run into each other.
    fn lets_segments_meet(&self) -> bool {
        true
    }

    /// Largest distance from a particle to a reconstructed place between particles, in spacings. By default the gaps
    /// beyond it are what other segments have swept.
    fn widest_bridge(&self) -> f64 {
        1.5
    }

    /// Largest radius of the search for the particles of a reconstruction, in spacings. The search grows by factors and
    /// stays below it.
    fn farthest_search(&self) -> f64 {
        6.0
    }

    /// Number of particles of the quadratic that replaces a wider polynomial in bends which that does not resolve; None
    /// where the wider polynomial is kept.
    fn particles_in_bends(&self) -> Option<usize> {
        None
    }

    // Corners and invariants of the front.

    /// Whether a corner becomes round on the side where it is the closest point at this signed distance.
    fn opens_corners(&self, _signed_distance: f64) -> bool {
        false
    }

    /// Whether one particle of the mean direction starts at a corner that opens, instead of a fan of all directions.
    fn rounds_corners_at_once(&self) -> bool {
        false
    }

    /// Length or area of the front, relative to that at the start, above which the run is unstable; None without a bound.
    fn most_growth(&self) -> Option<f64> {
        None
    }

    /// Whether a closed front never has open ends.
    fn keeps_fronts_closed(&self) -> bool {
        false
    }

    // Time steps.

    /// The largest speed, from which the CFL number follows; `extent` is the box about the front at the start, where known.
    fn top_speed(&self, extent: Option<&(Vector<D>, Vector<D>)>) -> f64;

    /// Default of dt · top speed/h; None for a law without a speed to measure a step by.
    fn default_cfl(&self) -> Option<f64>;

    /// Upper bound of a default time step: by the CFL number, and the period of a flow that returns has some steps.
    fn default_time_step(&self, plan: &StepPlan<D>) -> f64 {
        let cfl = plan.cfl.or_else(|| self.default_cfl()).unwrap_or(f64::INFINITY);
        let by_speed = cfl * plan.finest / self.top_speed(plan.extent.as_ref());
        self.return_time().map_or(by_speed, |period| by_speed.min(period / LEAST_STEPS_PER_PERIOD))
    }

    /// Longest stable time step, dt/h² with h of the finest level; None where stability does not bound it.
    fn longest_step(&self, _stability: &StabilityPlan) -> Option<f64> {
        None
    }

    /// Whether an integrator with error control can be used.
    fn takes_error_control(&self) -> bool {
        true
    }

    /// The time after which every particle is back at its start; None where that never happens.
    fn return_time(&self) -> Option<f64> {
        self.flow().and_then(Flow::return_time)
    }

    // Estimates and errors.

    /// The stretch of the front until `end_time`, for estimates of cost.
    fn stretch(&self, _start: &FrontAtStart<D>, _end_time: f64) -> Stretch {
        Stretch::NONE
    }

    /// The exact motion of the front, for errors.
    fn exact_motion(&self, _start: FrontAtStart<D>) -> Box<dyn ExactFrontMotion<D>> {
        Box::new(UnknownMotion)
    }
}

/// Least number of default time steps in the period of a flow that returns.
const LEAST_STEPS_PER_PERIOD: f64 = 32.0;

/// The front at time 0, as far as its shape is known.
pub struct FrontAtStart<const D: usize> {
    /// The whole front.
    pub surface: Box<dyn Surface<D>>,
    /// Its closed parts.
    pub parts: Vec<Box<dyn Surface<D>>>,
    /// The front as a ball, where it is one.
    pub ball: Option<Ball<D>>,
    /// What happens where segments meet.
    pub topology: Topology,
}

/// What a default time step depends on beside the law.
pub struct StepPlan<const D: usize> {
    /// h of the finest level.
    pub finest: f64,
    /// The CFL number, where it is given.
    pub cfl: Option<f64>,
    /// The box about the front at the start, where known.
    pub extent: Option<(Vector<D>, Vector<D>)>,
    /// What bounds a stable step.
    pub stability: StabilityPlan,
}

/// One time step of a motion.
pub struct MotionStep<'a> {
    /// Time at the start of the step.
    pub time: f64,
    /// dt.
    pub step: f64,
    /// Integrator of the paths.
    pub integrator: PathIntegrator,
    /// h of the finest level.
    pub spacing: f64,
    /// Asks a running step to be dropped.
    pub interrupt: &'a Interrupt,
}

/// The particles during the motion of one step.
pub struct MovingFront<'a, const D: usize> {
    /// The particles.
    pub feet: &'a mut FootPoints<D>,
    /// Storage for the stages of an integrator.
    pub stages: &'a mut Stages<D>,
    /// Computes normals and curvatures anew, from reconstructions through the particles where they are.
    pub renew_geometry: &'a mut dyn FnMut(&mut FootPoints<D>) -> Result<(), Interrupted>,
}

/// Storage for the stages of an integrator; it lasts from step to step.
#[derive(Debug, Default)]
pub struct Stages<const D: usize> {
    /// Positions at the start of the step.
    starts: Vec<Vector<D>>,
    /// Weighted sums of the velocities of the stages.
    slopes: Vec<Vector<D>>,
    /// Velocities of the present stage.
    velocities: Vec<Vector<D>>,
}

#[cfg(test)]
mod tests;
