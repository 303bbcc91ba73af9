//! The closest point on the zero of a local polynomial by a safeguarded Newton method (PCP eqs. 10 to 14).
//!
//! Splitting the Newton system of the Lagrangian into the normal n = ∇p/|∇p| and the tangent plane gives a normal
//! step −p/|∇p| and a tangential step with the reduced Hessian P (I + λ∇∇p) P, λ the least-squares multiplier. The
//! reduced Hessian's pivots are held above a floor and the step's length below a share of the support, so the
//! iteration cannot run off; near the solution both bounds are inactive and convergence is quadratic.

use super::method::PcpMethod;
use crate::geometry::Vector;
use crate::linear_algebra::small_system::solve_symmetric_floored;
use crate::polynomials::{Fit, Jet, LocalPolynomial};
use nalgebra::SMatrix;

/// How an iteration ended.
#[derive(Debug, Clone, Copy)]
pub enum NewtonEnd<const D: usize> {
    /// A stationary point of the distance on p = 0.
    Converged(Foot<D>),
    /// The iterate left the support of the fit; another sample may know more there.
    LeftSupport(Vector<D>),
    /// The iteration did not settle.
    Stuck,
}

/// A closest point with the polynomial's derivatives there.
#[derive(Debug, Clone, Copy)]
pub struct Foot<const D: usize> {
    /// The point.
    pub point: Vector<D>,
    /// p, ∇p, ∇∇p there.
    pub jet: Jet<D>,
}

/// Least pivot of the reduced Hessian; 1 is a plane, 0 the centre of curvature.
const PIVOT_FLOOR: f64 = 0.1;
/// Longest step as a share of the support's radius.
const LONGEST_STEP: f64 = 0.4;
/// An end is accepted when the last step is shorter than this share of the support.
const ACCEPTED: f64 = 1e-7;

/// Finds the point of p = 0 nearest to `query`, beginning at `start`. Returns the end and the iterations made.
#[must_use]
pub fn closest_point<const D: usize>(
    method: &PcpMethod,
    polynomial: &LocalPolynomial<D>,
    fit: &Fit<D>,
    query: &Vector<D>,
    start: &Vector<D>,
) -> (NewtonEnd<D>, u32) {
    let mut x = *start;
    let mut last = f64::INFINITY;
    for iteration in 1..=method.max_iterations {
        let jet = polynomial.jet(&(x - fit.centre));
        let Some(mut step) = newton_step(&jet, &(query - x)) else {
            return (NewtonEnd::Stuck, iteration);
        };
        let length = step.norm();
        let stalled = length <= ACCEPTED * fit.radius && length >= 0.5 * last;
        // Coordinates cannot move by less than their own last bit.
        if method.is_converged(&step) || stalled || length <= f64::EPSILON * x.amax() {
            // The jet is evaluated at most one converged step away: its change is below the step itself.
            return (NewtonEnd::Converged(Foot { point: x + step, jet }), iteration);
        }
        let most = LONGEST_STEP * fit.radius;
        if length > most {
            step *= most / length;
        }
        x += step;
        if (x - fit.middle).norm() > fit.radius {
            return (NewtonEnd::LeftSupport(x), iteration);
        }
        last = length;
    }
    (NewtonEnd::Stuck, method.max_iterations)
}

/// One step for the offset `query − x`; None where the gradient vanishes or numbers are not finite.
fn newton_step<const D: usize>(jet: &Jet<D>, offset: &Vector<D>) -> Option<Vector<D>> {
    let slope = jet.gradient.norm();
    if !(slope > 0.0 && jet.value.is_finite() && slope.is_finite()) {
        return None;
    }
    let n = jet.gradient / slope;
    // x − query + λ∇p = 0 in the least-squares sense.
    let lambda = offset.dot(&n) / slope;
    let bent = SMatrix::<f64, D, D>::identity() + jet.hessian * lambda;
    let normal_step = n * (-jet.value / slope);
    let pull = offset - bent * normal_step;
    let tangential = pull - n * n.dot(&pull);
    let projector = SMatrix::<f64, D, D>::identity() - n * n.transpose();
    let reduced = projector * bent * projector + n * n.transpose();
    let (slide, _) = solve_symmetric_floored(&reduced, &tangential, PIVOT_FLOOR);
    let step = normal_step + (slide - n * n.dot(&slide));
    step.iter().all(|s| s.is_finite()).then_some(step)
}
