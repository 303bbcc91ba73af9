//! Projection onto the zero of a local polynomial along its gradient (PCP eq. 9).

use super::method::PcpMethod;
use crate::geometry::Vector;
use crate::polynomials::{Fit, LocalPolynomial};

/// Where the projection ended, and the gradient there.
#[derive(Debug, Clone, Copy)]
pub struct Projected<const D: usize> {
    /// A point with p = 0 to the tolerance or to round-off.
    pub point: Vector<D>,
    /// ∇p/|∇p| there.
    pub normal: Vector<D>,
}

/// An end is accepted when the last step is shorter than this share of the support.
const ACCEPTED: f64 = 1e-7;

/// Moves `start` onto p = 0; None when the iteration leaves the support of the fit or does not settle.
#[must_use]
pub fn project<const D: usize>(
    method: &PcpMethod,
    polynomial: &LocalPolynomial<D>,
    fit: &Fit<D>,
    start: &Vector<D>,
) -> Option<Projected<D>> {
    let mut x = *start;
    let mut last = f64::INFINITY;
    for _ in 0..method.max_iterations {
        let jet = polynomial.jet(&(x - fit.centre));
        let slope = jet.gradient.norm_squared();
        if !(slope > 0.0 && jet.value.is_finite()) {
            return None;
        }
        let mut step = jet.gradient * (-jet.value / slope);
        let length = step.norm();
        let settled = length <= method.tolerance;
        // Round-off may keep the residual above the tolerance for ever: no progress at a tiny step is the end too.
        let stalled = length <= ACCEPTED * fit.radius && length >= 0.5 * last;
        // Coordinates cannot move by less than their own last bit.
        if settled || stalled || length <= f64::EPSILON * x.amax() {
            return Some(Projected { point: x + step, normal: jet.normal() });
        }
        let most = 0.5 * fit.radius;
        if length > most {
            step *= most / length;
        }
        x += step;
        if (x - fit.middle).norm() > fit.radius {
            return None;
        }
        last = length;
    }
    (last <= ACCEPTED * fit.radius).then(|| {
        let jet = polynomial.jet(&(x - fit.centre));
        Projected { point: x, normal: jet.normal() }
    })
}
