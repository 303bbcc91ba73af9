//! Projection onto the zero of a local polynomial along its gradient (PCP eq. 9).

use super::method::PcpMethod;
use super::newton::ACCEPTED;
use crate::geometry::Vector;
use crate::polynomials::{Fit, Jet, LocalPolynomial};

/// Moves `start` onto p = 0 and returns the jet there; None when the iteration leaves the support of the fit or does not
/// settle.
#[must_use]
pub fn project<const D: usize>(
    method: &PcpMethod,
    polynomial: &LocalPolynomial<D>,
    fit: &Fit<D>,
    start: &Vector<D>,
) -> Option<(Vector<D>, Jet<f64, D>)> {
    let mut x = *start;
    let mut last = f64::INFINITY;
    for _ in 0..method.max_iterations {
        let jet = polynomial.jet(&(x - fit.centre));
        let gradient = Vector::<D>::from(jet.gradient);
        let slope = gradient.norm_squared();
        if !(slope > 0.0 && jet.value.is_finite()) {
            return None;
        }
        let mut step = gradient * (-jet.value / slope);
        let length = step.norm();
        // Round-off may keep the residual above the tolerance for ever: no progress at a tiny step is the end too.
        let is_stalled = length <= ACCEPTED * fit.radius && length >= 0.5 * last;
        // The next step would be shorter than the square of this one, and coordinates cannot move by less than their
        // own last bit.
        let is_quadratic = length <= ACCEPTED * fit.radius && length <= 1e-2 * last;
        if length <= method.tolerance || is_stalled || is_quadratic || length <= f64::EPSILON * x.amax() {
            return Some((x + step, jet.moved(&step.into())));
        }
        let most = 0.5 * fit.radius;
        if length > most {
            step *= most / length;
        }
        x += step;
        if (x - fit.middle).norm_squared() > fit.radius * fit.radius {
            return None;
        }
        last = length;
    }
    (last <= ACCEPTED * fit.radius).then(|| (x, polynomial.jet(&(x - fit.centre))))
}
