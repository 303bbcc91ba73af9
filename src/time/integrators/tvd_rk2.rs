//! The second-order TVD Runge–Kutta scheme (Shu 1988): the mean of the start and the result of two Euler steps.

use crate::geometry::{Flow, Vector};

/// The position at `t + dt` of the point at `x` at time `t`.
pub(super) fn advance<const D: usize>(flow: &dyn Flow<D>, x: &Vector<D>, t: f64, dt: f64) -> Vector<D> {
    let once = x + flow.velocity(x, t) * dt;
    let twice = once + flow.velocity(&once, t + dt) * dt;
    (x + twice) * 0.5
}
