//! Whether a flow with a given period brings points back, as it must for exact answers to be right.

use crate::geometry::{Flow, Surface, Vector};
use crate::spec::Violation;
use crate::time::PathIntegrator;
use serde_json::Value;

/// Error of an inner step of the paths that are tried, relative to the extent of the shape.
const TOLERANCE: f64 = 1e-8;
/// Distance from its start, relative to the extent of the shape, up to which a point is back.
const BACK: f64 = 1e-5;

/// What is wrong with the period of a flow about a shape: after it a point of the shape is elsewhere. Pointers of errors begin with
/// `pointer`.
#[must_use]
pub fn check_return<const D: usize>(flow: &dyn Flow<D>, surface: &dyn Surface<D>, pointer: &str) -> Option<Violation> {
    // Built-in flows return by their formulas.
    let period = flow.return_time().filter(|_| flow.divergences(&[], 0.0).is_some())?;
    let (low, high) = surface.bounding_box();
    let extent = (high - low).max();
    let starts: Vec<Vector<D>> = (0..9)
        .map(|k| {
            let share = |d: usize| if k == 8 { 0.5 } else { f64::from(k >> d & 1) };
            surface.nearest(&Vector::<D>::from_fn(|d, _| low[d] + share(d) * (high[d] - low[d]))).point
        })
        .collect();
    let mut ends = starts.clone();
    PathIntegrator::Dopri5 { tolerance: TOLERANCE * extent }.advance_all(flow, &mut ends, 0.0, period);
    let distances = starts.iter().zip(&ends).map(|(start, end)| (end - start).norm());
    let farthest = distances.fold(0.0_f64, |most, distance| if distance.is_nan() { most } else { most.max(distance) });
    (farthest > BACK * extent).then(|| {
        let detail =
            format!("after the period {period} points of the shape are up to {farthest:.3e} away from their start");
        Violation::new(
            format!("{pointer}/period"),
            "conflict",
            detail,
            period,
            Value::from("null, or a time after which all points are back"),
        )
    })
}
