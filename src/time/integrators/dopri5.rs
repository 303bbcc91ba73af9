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
/// Inner steps below this share of the whole end at a NaN: the path has come to a place without a velocity.
const LEAST_STEP: f64 = 1e-12;

/// Inner steps of up to `N` paths. Each path has its own step size and ends by itself.
struct Paths<const D: usize, const N: usize> {
    /// Velocities of the stages, by path.
    k: [[Vector<D>; N]; 7],
    /// Time since the start, and the size of the next inner step.
    done: [f64; N],
    size: [f64; N],
    /// Where the paths are that go on.
    active: [usize; N],
    /// Storage of an evaluation: one entry for each path that goes on.
    at: [Vector<D>; N],
    times: [f64; N],
    found: [Vector<D>; N],
}

/// Moves up to `N` points from `t` to `t + dt`; a point is NaN after [`MAX_STEPS`] inner steps, and where its path meets a place
/// without a velocity.
pub(super) fn advance<const D: usize, const N: usize>(
    flow: &dyn Flow<D>,
    points: &mut [Vector<D>],
    t: f64,
    dt: f64,
    tolerance: f64,
) {
    if dt == 0.0 {
        return;
    }
    let zero = [Vector::<D>::zeros(); N];
    let mut paths = Paths::<D, N> {
        k: [zero; 7],
        done: [0.0; N],
        size: [dt.abs().min(0.05); N],
        active: std::array::from_fn(|i| i),
        at: zero,
        times: [t; N],
        found: zero,
    };
    let mut count = points.len();
    flow.velocities(points, &paths.times[..count], &mut paths.k[0][..count]);
    for _ in 0..MAX_STEPS {
        count = paths.inner_step(flow, points, [t, dt, tolerance], count);
        if count == 0 {
            return;
        }
    }
    for i in &paths.active[..count] {
        points[*i] = Vector::<D>::repeat(f64::NAN);
    }
}

impl<const D: usize, const N: usize> Paths<D, N> {
    /// One inner step of the first `count` active paths; returns how many go on.
    fn inner_step(
        &mut self,
        flow: &dyn Flow<D>,
        points: &mut [Vector<D>],
        [t, dt, tolerance]: [f64; 3],
        count: usize,
    ) -> usize {
        let (direction, whole) = (dt.signum(), dt.abs());
        let is_last = |remaining: f64, size: f64| size >= remaining * (1.0 - 1e-12);
        let mut steps = [0.0; N];
        for (step, &i) in steps.iter_mut().zip(&self.active[..count]) {
            let remaining = whole - self.done[i];
            *step = direction * if is_last(remaining, self.size[i]) { remaining } else { self.size[i] };
        }
        for s in 0..6 {
            for (slot, &i) in self.active[..count].iter().enumerate() {
                let mut slope = Vector::<D>::zeros();
                for (j, a) in A[s][..=s].iter().enumerate() {
                    slope += self.k[j][i] * *a;
                }
                self.at[slot] = points[i] + slope * steps[slot];
                self.times[slot] = t + direction * self.done[i] + C[s] * steps[slot];
            }
            flow.velocities(&self.at[..count], &self.times[..count], &mut self.found[..count]);
            for (found, &i) in self.found[..count].iter().zip(&self.active[..count]) {
                self.k[s + 1][i] = *found;
            }
        }
        let mut next = 0;
        for (slot, step) in steps.into_iter().enumerate().take(count) {
            let i = self.active[slot];
            let mut error = Vector::<D>::zeros();
            for (j, e) in E.iter().enumerate() {
                error += self.k[j][i] * *e;
            }
            let error = (error * step).norm();
            // No tolerance below round-off can be met.
            let is_accepted = error <= tolerance.max(4.0 * f64::EPSILON * points[i].amax());
            if is_accepted {
                let was_last = is_last(whole - self.done[i], self.size[i]);
                points[i] = self.at[slot];
                if was_last {
                    continue;
                }
                self.done[i] += step.abs();
                self.k[0][i] = self.k[6][i];
            }
            // Beyond a place without a velocity the error is no number: a shorter step may end before it.
            let change = if error.is_nan() { 0.2 } else { 0.9 * (tolerance / error.max(1e-300)).powf(0.2) };
            self.size[i] = step.abs() * change.clamp(0.2, 5.0);
            if self.size[i] < LEAST_STEP * whole && !is_accepted {
                points[i] = Vector::<D>::repeat(f64::NAN);
                continue;
            }
            self.active[next] = i;
            next += 1;
        }
        next
    }
}
