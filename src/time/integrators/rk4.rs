//! The classical Runge–Kutta scheme of order four: x + dt (k₁ + 2 k₂ + 2 k₃ + k₄)/6.

use crate::geometry::{Flow, Vector};

/// Moves up to `N` points from `t` to `t + dt`.
pub(super) fn advance<const D: usize, const N: usize>(flow: &dyn Flow<D>, points: &mut [Vector<D>], t: f64, dt: f64) {
    let count = points.len();
    let zero = [Vector::<D>::zeros(); N];
    let (mut at, mut k1, mut k2, mut k3, mut k4) = (zero, zero, zero, zero, zero);
    flow.velocities(points, &[t; N][..count], &mut k1[..count]);
    for i in 0..count {
        at[i] = points[i] + k1[i] * (0.5 * dt);
    }
    flow.velocities(&at[..count], &[t + 0.5 * dt; N][..count], &mut k2[..count]);
    for i in 0..count {
        at[i] = points[i] + k2[i] * (0.5 * dt);
    }
    flow.velocities(&at[..count], &[t + 0.5 * dt; N][..count], &mut k3[..count]);
    for i in 0..count {
        at[i] = points[i] + k3[i] * dt;
    }
    flow.velocities(&at[..count], &[t + dt; N][..count], &mut k4[..count]);
    for i in 0..count {
        points[i] += (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (dt / 6.0);
    }
}
