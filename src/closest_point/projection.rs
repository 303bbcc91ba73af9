//! Projection onto the zero of a local polynomial along its gradient (PCP eq. 9), in space or in initial positions.

use super::method::PcpMethod;
use super::newton::ACCEPTED;
use crate::geometry::Vector;
use crate::polynomials::Fit;

/// Longest step as a share of the support's radius.
const LONGEST_STEP: f64 = 0.5;

/// Where a projection ends: at `x + step`, at most one last short step from where the polynomial was evaluated.
#[derive(Debug, Clone, Copy)]
pub struct Projected<T, const D: usize> {
    /// Where the polynomial was evaluated last.
    pub x: Vector<D>,
    /// The last step.
    pub step: Vector<D>,
    /// What was found there.
    pub found: T,
}

/// Moves `start` onto the zero of what `evaluate` gives as value and gradient, with whatever the caller wants to know
/// of the place; None when the iteration leaves the support of the fit or does not settle.
#[must_use]
pub fn project<T, const D: usize>(
    method: &PcpMethod,
    fit: &Fit<D>,
    start: &Vector<D>,
    evaluate: impl Fn(&Vector<D>) -> Option<(f64, Vector<D>, T)>,
) -> Option<Projected<T, D>> {
    let mut x = *start;
    let mut last = f64::INFINITY;
    for _ in 0..method.max_iterations {
        let (value, gradient, found) = evaluate(&x)?;
        let slope = gradient.norm_squared();
        if !(slope > 0.0 && value.is_finite()) {
            return None;
        }
        let mut step = gradient * (-value / slope);
        let length = step.norm();
        // Round-off may keep the residual above the tolerance for ever: no progress at a tiny step is the end too.
        let is_stalled = length <= ACCEPTED * fit.radius && length >= 0.5 * last;
        // The next step would be shorter than the square of this one, and coordinates cannot move by less than their
        // own last bit.
        let is_quadratic = length <= ACCEPTED * fit.radius && length <= 1e-2 * last;
        if length <= method.tolerance || is_stalled || is_quadratic || length <= f64::EPSILON * x.amax() {
            return Some(Projected { x, step, found });
        }
        let most = LONGEST_STEP * fit.radius;
        if length > most {
            step *= most / length;
        }
        x += step;
        if (x - fit.middle).norm_squared() > fit.radius * fit.radius {
            return None;
        }
        last = length;
    }
    let (_, _, found) = evaluate(&x).filter(|_| last <= ACCEPTED * fit.radius)?;
    Some(Projected { x, step: Vector::<D>::zeros(), found })
}
