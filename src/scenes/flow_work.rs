//! Cost of the exact motion of a front in a flow, before the run.

use crate::geometry::{Flow, Surface};
use crate::schemes::exact_motion::front_points;

/// Units of work of a tight path through one unit of time, against the distance of one particle from a known shape.
const PATH: f64 = 100.0;

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
    paths * length * PATH * flow.relative_cost()
}
