//! The embedded Runge–Kutta pair of order 5(4) of Dormand 1980 with local error control.
//!
//! The step h is accepted when the difference of both orders is at most the tolerance. The next step is 0.9 h
//! (tolerance/error)^(1/5), between h/5 and 5 h.

use crate::geometry::{Flow, Vector};

/// Coefficients of the stages (Dormand 1980, RK5(4)7M). The last row is the solution of order 5.
pub(in crate::time) const A: [[f64; 6]; 6] = [
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// Times of the stages after the first, as fractions of the step.
pub(in crate::time) const C: [f64; 6] = [0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
/// Weights of order 5 minus weights of order 4.
pub(in crate::time) const E: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339_200.0, 22.0 / 525.0, -1.0 / 40.0];
/// Largest number of inner steps. After it the position is NaN, so that a wild field cannot hang a run.
const MAX_STEPS: u32 = 100_000;

/// The position at `t + dt` of the point at `x` at time `t`; NaN after [`MAX_STEPS`] inner steps.
pub(super) fn advance<const D: usize>(flow: &dyn Flow<D>, x: &Vector<D>, t: f64, dt: f64, tolerance: f64) -> Vector<D> {
    if dt == 0.0 {
        return *x;
    }
    let direction = dt.signum();
    let whole = dt.abs();
    let mut x = *x;
    let mut done = 0.0;
    let mut h = whole.min(0.05);
    let mut k = [Vector::<D>::zeros(); 7];
    k[0] = flow.velocity(&x, t);
    for _ in 0..MAX_STEPS {
        let remaining = whole - done;
        let last = h >= remaining * (1.0 - 1e-12);
        let step = direction * if last { remaining } else { h };
        let now = t + direction * done;
        let mut next = x;
        for s in 0..6 {
            let mut slope = Vector::<D>::zeros();
            for (j, a) in A[s][..=s].iter().enumerate() {
                slope += k[j] * *a;
            }
            next = x + slope * step;
            k[s + 1] = flow.velocity(&next, now + C[s] * step);
        }
        let mut error = Vector::<D>::zeros();
        for (j, e) in E.iter().enumerate() {
            error += k[j] * *e;
        }
        let error = (error * step).norm();
        // No tolerance below round-off can be met.
        if error <= tolerance.max(4.0 * f64::EPSILON * x.amax()) {
            x = next;
            if last {
                return x;
            }
            done += step.abs();
            k[0] = k[6];
        }
        h = step.abs() * (0.9 * (tolerance / error.max(1e-300)).powf(0.2)).clamp(0.2, 5.0);
    }
    Vector::<D>::repeat(f64::NAN)
}
