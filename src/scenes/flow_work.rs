//! How long a flow draws a front out, and what its exact motion costs, before anything is run.

use crate::geometry::flows::Stretch;
use crate::geometry::{Flow, Surface, Vector};
use crate::schemes::exact_motion::front_points;
use crate::time::PathIntegrator;

/// Points of a front that is carried along to learn how long it becomes, by its extent, and the steps: the vortices turn once in about
/// a unit of time.
const FRONT_PART: f64 = 0.02;
const FRONT_STEPS: f64 = 80.0;
const LONGEST_STEP: f64 = 0.1;
const MOST_STEPS: f64 = 2000.0;
/// Units of work of a tight path through one unit of time, against the distance of one particle from a known shape.
const PATH: f64 = 100.0;

/// How much a flow stretches a surface: 1 in a rigid motion, and in space, where outlines are not known. Of a flow that returns one
/// period tells all.
#[must_use]
pub fn stretch<const D: usize>(surface: &dyn Surface<D>, flow: &dyn Flow<D>, end_time: f64) -> Stretch {
    let end_time = flow.return_time().map_or(end_time, |period| end_time.min(period));
    let (low, high) = surface.bounding_box();
    let mut chains = surface.outline(FRONT_PART * (high - low).max());
    let length = |chains: &[Vec<Vector<D>>]| -> f64 {
        chains.iter().flat_map(|chain| chain.windows(2)).map(|pair| (pair[1] - pair[0]).norm()).sum()
    };
    let start = length(&chains);
    if flow.is_rigid() || start.is_nan() || start <= 0.0 {
        return Stretch::NONE;
    }
    let steps = (end_time / LONGEST_STEP).ceil().clamp(FRONT_STEPS, MOST_STEPS);
    let step = end_time / steps;
    let (mut sum, mut most) = (0.0, 1.0_f64);
    for k in 0..steps as u32 {
        for x in chains.iter_mut().flatten() {
            *x = PathIntegrator::Rk4.advance(flow, x, k as f64 * step, step);
        }
        let now = length(&chains) / start;
        sum += now;
        most = most.max(now);
    }
    Stretch { mean: sum / steps, most }
}

/// Units of work of all errors of a run: distances of the particles, and where the exact front is not known by a formula the
/// paths of its points and of the particles.
#[must_use]
pub fn error_units<const D: usize>(
    surface: Option<&dyn Surface<D>>,
    flow: &dyn Flow<D>,
    spacing: f64,
    particles: f64,
    end_time: f64,
) -> f64 {
    let points = surface.filter(|_| D == 2).map_or(0.0, |surface| {
        let (low, high) = surface.bounding_box();
        front_points((high - low).max(), spacing)
    });
    particles + path_units(flow, points + particles, end_time)
}

/// Units of work of tight paths to the moments of errors.
#[must_use]
pub fn path_units<const D: usize>(flow: &dyn Flow<D>, paths: f64, end_time: f64) -> f64 {
    let halfway = flow.return_time().map(|turn| 0.5 * turn).filter(|half| *half <= end_time);
    let at_end = if flow.is_back(end_time) { 0.0 } else { end_time };
    let length = if flow.is_rigid() { 0.0 } else { at_end + halfway.unwrap_or(0.0) };
    paths * length * PATH
}
