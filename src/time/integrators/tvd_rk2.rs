//! The second-order TVD Runge–Kutta scheme (Shu 1988): the mean of the start and the result of two Euler steps.

use crate::geometry::{Flow, Vector};

/// Moves up to `N` points from `t` to `t + dt`.
pub(super) fn advance<const D: usize, const N: usize>(flow: &dyn Flow<D>, points: &mut [Vector<D>], t: f64, dt: f64) {
    let count = points.len();
    let zero = [Vector::<D>::zeros(); N];
    let (mut once, mut u) = (zero, zero);
    flow.velocities(points, &[t; N][..count], &mut u[..count]);
    for i in 0..count {
        once[i] = points[i] + u[i] * dt;
    }
    flow.velocities(&once[..count], &[t + dt; N][..count], &mut u[..count]);
    for i in 0..count {
        points[i] = (points[i] + (once[i] + u[i] * dt)) * 0.5;
    }
}
