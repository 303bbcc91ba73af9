//! Projection onto the zero of a local polynomial along its gradient (PCP eq. 9), in space or in initial positions.
//!
//! The iteration is x ← x − p ∇p/‖∇p‖² with steps of limited length.

use super::method::PcpMethod;
use super::newton::ACCEPTED;
use crate::geometry::Vector;
use crate::polynomials::Fit;

/// Longest step, as a fraction of the support's radius.
const LONGEST_STEP: f64 = 0.5;

/// Result of a projection, the point `x + step`.
#[derive(Debug, Clone, Copy)]
pub struct Projected<T, const D: usize> {
    /// Position of the last evaluation of the polynomial.
    pub x: Vector<D>,
    /// The last, short step, after which the polynomial was not evaluated again.
    pub step: Vector<D>,
    /// Result of the last evaluation.
    pub found: T,
}

/// Projects `start` onto the zero of a polynomial.
///
/// - `fit`: geometry of the fit, whose support bounds the iteration.
/// - `evaluate`: value, gradient, and any further result at a point; None ends the projection.
///
/// Returns None when the iteration leaves the support of the fit or does not converge.
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
        // Round-off may keep the residual above the tolerance. The iteration also ends when tiny steps do not get
        // shorter.
        let is_stalled = length <= ACCEPTED * fit.radius && length >= 0.5 * last;
        // Convergence is quadratic: the next step would be shorter than the square of this one. Nor can coordinates
        // change by less than their last bit.
        let is_quadratic = length <= ACCEPTED * fit.radius && length <= 1e-2 * last;
        if length <= method.tolerance || is_stalled || is_quadratic || length <= f64::EPSILON * x.amax() {
            return Some(Projected { x, step, found });
        }
        let longest = LONGEST_STEP * fit.radius;
        if length > longest {
            step *= longest / length;
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
