//! Motion with a constant speed along the outward normal.

use super::{FrontAtStart, FrontLaw, MotionStep, MovingFront};
use crate::geometry::Vector;
use crate::geometry::flows::Stretch;
use crate::schemes::grid_based_particle::exact_front::{ExactFrontMotion, OffsetFront};
use crate::schemes::grid_based_particle::foot_points::FootPoints;
use crate::time::integrators::PathError;

/// The law of a constant speed: the velocity is c n. Paths are straight lines, along which normals stay as they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalSpeed {
    /// Speed c, positive outward.
    pub speed: f64,
}

/// Default CFL number dt · |c|/h, that of GBPM 4.1.
const DEFAULT_CFL: f64 = 0.75;

impl<const D: usize, const M: usize> FrontLaw<D, M> for NormalSpeed {
    fn name(&self) -> &'static str {
        "normal"
    }

    fn velocity(&self, feet: &FootPoints<D>, i: usize, _time: f64) -> Vector<D> {
        feet.normals[i] * self.speed
    }

    fn advance(&self, front: &mut MovingFront<'_, D>, step: &MotionStep<'_>) -> Result<f64, PathError> {
        let displacement = self.speed * step.step;
        for (x, n) in front.feet.positions.iter_mut().zip(&front.feet.normals) {
            *x += n * displacement;
        }
        Ok(if front.feet.is_empty() { 0.0 } else { displacement.abs() / step.spacing })
    }

    fn normal_displacement(&self, _feet: &FootPoints<D>, _i: usize, _time: f64, step: f64) -> f64 {
        self.speed * step
    }

    fn facing(&self, _feet: &FootPoints<D>, _i: usize) -> f64 {
        self.speed.signum()
    }

    /// Corners open towards the side to which they move.
    fn opens_corners(&self, signed_distance: f64) -> bool {
        self.speed * signed_distance > 0.0
    }

    fn top_speed(&self, _extent: Option<&(Vector<D>, Vector<D>)>) -> f64 {
        self.speed.abs()
    }

    fn default_cfl(&self) -> Option<f64> {
        Some(DEFAULT_CFL)
    }

    /// A front that grows becomes larger as the boxes about its parts do.
    fn stretch(&self, start: &FrontAtStart<D>, end_time: f64) -> Stretch {
        if self.speed.is_nan() || self.speed <= 0.0 {
            return Stretch::NONE;
        }
        let growth = |(low, high): (Vector<D>, Vector<D>)| 1.0 + 2.0 * self.speed * end_time / (high - low).max();
        let largest = start.parts.iter().map(|part| growth(part.bounding_box())).fold(1.0, f64::max);
        let most = largest.powi(D as i32 - 1);
        Stretch { mean: 0.5 * (1.0 + most), most }
    }

    fn exact_motion(&self, start: FrontAtStart<D>) -> Box<dyn ExactFrontMotion<D>> {
        Box::new(OffsetFront { surfaces: start.parts, speed: self.speed, topology: start.topology })
    }
}
