//! How many times longer a flow makes a front, measured by carrying its outline along.

use crate::geometry::flows::Stretch;
use crate::geometry::{Flow, Surface, Vector};
use crate::time::PathIntegrator;

/// Spacing of the carried points, relative to the extent of the front.
const SPACING: f64 = 0.02;
/// Least number of steps. The vortices turn once in about a unit of time.
const LEAST_STEPS: f64 = 80.0;
/// Longest step, in units of time.
const LONGEST_STEP: f64 = 0.1;
/// Largest number of steps.
const MOST_STEPS: f64 = 2000.0;

/// The stretch of a surface until `end_time`: none in a rigid motion, and none in space, where outlines are not known. In a
/// flow that returns it is measured over one period at most.
#[must_use]
pub fn front_stretch<const D: usize>(surface: &dyn Surface<D>, flow: &dyn Flow<D>, end_time: f64) -> Stretch {
    let end_time = flow.return_time().map_or(end_time, |period| end_time.min(period));
    let (low, high) = surface.bounding_box();
    let mut chains = surface.outline(SPACING * (high - low).max());
    let length = |chains: &[Vec<Vector<D>>]| -> f64 {
        chains.iter().flat_map(|chain| chain.windows(2)).map(|pair| (pair[1] - pair[0]).norm()).sum()
    };
    let start = length(&chains);
    if flow.is_rigid() || start.is_nan() || start <= 0.0 {
        return Stretch::NONE;
    }
    let steps = (end_time / LONGEST_STEP).ceil().clamp(LEAST_STEPS, MOST_STEPS);
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
