//! The classical Runge–Kutta scheme of order four: x + dt (k₁ + 2 k₂ + 2 k₃ + k₄)/6.

use crate::geometry::{Flow, Vector};

/// The position at `t + dt` of the point at `x` at time `t`.
pub(super) fn advance<const D: usize>(flow: &dyn Flow<D>, x: &Vector<D>, t: f64, dt: f64) -> Vector<D> {
    let k1 = flow.velocity(x, t);
    let k2 = flow.velocity(&(x + k1 * (0.5 * dt)), t + 0.5 * dt);
    let k3 = flow.velocity(&(x + k2 * (0.5 * dt)), t + 0.5 * dt);
    let k4 = flow.velocity(&(x + k3 * dt), t + dt);
    x + (k1 + (k2 + k3) * 2.0 + k4) * (dt / 6.0)
}
