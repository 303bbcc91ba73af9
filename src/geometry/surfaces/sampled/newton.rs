//! The closest point near a start on the common zero of one to D level functions.

use super::Vector;
use crate::geometry::level::{Hessian, LevelFunction};

/// Iterations at most.
const MOST_ITERATIONS: usize = 60;
/// Iterations of a projection at most: of a zero that is not simple, where each gains a fixed part of a digit, none ends.
const MOST_PROJECTIONS: usize = 25;
/// Least angle of gradients of levels that meet, as the sine.
const LEAST_ANGLE: f64 = 1e-6;
/// Least curvature of the squared distance along the surface with which a step is Newton's; below it the distance has no
/// minimum near, and the step goes downhill.
const LEAST_STRETCH: f64 = 1e-9;
/// Curvature that stands for a smaller one in steps downhill.
const DOWNHILL: f64 = 0.1;
/// Largest way from the start, in largest steps.
const FARTHEST: f64 = 8.0;
/// Steps this short, relative to the largest, that no longer shrink are round-off.
const ROUND_OFF: f64 = 1e-5;
/// Largest part along the surface of the way to a closest point that is not at a kink.
const SMOOTH: f64 = 1e-7;
/// Largest distance from the zero to first order that is round-off, relative to the lengths of the problem.
const ON_ZERO: f64 = 1e-11;

/// A stationary point of the distance on the common zero of levels.
#[derive(Debug, Clone, Copy)]
pub(in crate::geometry::surfaces) struct LocalFoot<const D: usize> {
    /// The point.
    pub point: Vector<D>,
    /// Least second derivative of half the squared distance along the zero: 1 + κd on a curve of curvature κ, which vanishes
    /// at a center of curvature. Infinite at a corner.
    pub stretch: f64,
    /// Whether the levels are smooth there.
    pub is_smooth: bool,
}

/// Orthonormal vectors of the same span as gradients, with the triangular factor.
struct Factors<const D: usize> {
    q: [Vector<D>; D],
    r: [[f64; D]; D],
    count: usize,
}

impl<const D: usize> Factors<D> {
    /// Gram–Schmidt; None where gradients vanish, are parallel or not finite.
    fn new(gradients: &[Vector<D>]) -> Option<Self> {
        let mut found = Self { q: [Vector::<D>::zeros(); D], r: [[0.0; D]; D], count: gradients.len() };
        for (j, gradient) in gradients.iter().enumerate() {
            let mut rest = *gradient;
            for i in 0..j {
                found.r[i][j] = found.q[i].dot(&rest);
                rest -= found.q[i] * found.r[i][j];
            }
            let length = rest.norm();
            if !(length > LEAST_ANGLE * gradient.norm() && length.is_finite()) {
                return None;
            }
            found.r[j][j] = length;
            found.q[j] = rest / length;
        }
        Some(found)
    }

    /// The shortest step to the zero of the linear levels.
    fn to_zero(&self, values: &[f64]) -> Vector<D> {
        let mut z = [0.0; D];
        let mut step = Vector::<D>::zeros();
        for j in 0..self.count {
            let known: f64 = (0..j).map(|i| self.r[i][j] * z[i]).sum();
            z[j] = (-values[j] - known) / self.r[j][j];
            step += self.q[j] * z[j];
        }
        step
    }

    /// Factors of the gradients whose sum is nearest to a vector.
    fn multipliers(&self, vector: &Vector<D>) -> [f64; D] {
        let mut found = [0.0; D];
        for i in (0..self.count).rev() {
            let known: f64 = (i + 1..self.count).map(|j| self.r[i][j] * found[j]).sum();
            found[i] = (self.q[i].dot(vector) - known) / self.r[i][i];
        }
        found
    }

    /// Unit vectors orthogonal to the gradients and to each other; D − count of them.
    fn tangents(&self) -> [Vector<D>; D] {
        let mut found = [Vector::<D>::zeros(); D];
        for a in 0..D - self.count {
            let remainder = |d: usize| {
                let mut e = Vector::<D>::zeros();
                e[d] = 1.0;
                for known in self.q[..self.count].iter().chain(&found[..a]) {
                    e -= known * known.dot(&e);
                }
                e
            };
            let longest = (0..D).map(remainder).fold(Vector::<D>::zeros(), |best, next| {
                if next.norm_squared() > best.norm_squared() { next } else { best }
            });
            found[a] = longest.normalize();
        }
        found
    }
}

/// The step along tangents that minimizes ½ pᵀ W p − rᵀ p, and the least eigenvalue of W there.
fn tangential_step<const D: usize>(
    tangents: &[Vector<D>],
    stretch: &Hessian<D>,
    residual: &Vector<D>,
) -> (Vector<D>, f64) {
    let divisor = |value: f64| if value > LEAST_STRETCH { value } else { value.abs().max(DOWNHILL) };
    match tangents {
        [] => (Vector::<D>::zeros(), f64::INFINITY),
        [along] => {
            let value = along.dot(&(stretch * along));
            (along * (along.dot(residual) / divisor(value)), value)
        }
        [first, second, ..] => {
            let (a, c) = (first.dot(&(stretch * first)), second.dot(&(stretch * second)));
            let b = first.dot(&(stretch * second));
            let (mean, spread) = (0.5 * (a + c), (0.5 * (a - c)).hypot(b));
            let (sin, cos) = (0.5 * (2.0 * b).atan2(a - c)).sin_cos();
            let wide = first * cos + second * sin;
            let narrow = second * cos - first * sin;
            let step = wide * (wide.dot(residual) / divisor(mean + spread))
                + narrow * (narrow.dot(residual) / divisor(mean - spread));
            (step, mean - spread)
        }
    }
}

/// The point near `start` on the common zero of the levels where the distance from `x` is stationary. Steps are at most
/// `reach` long. None where the iteration leaves the start's surroundings or does not end.
///
/// Each step solves the quadratic model of the distance on the linear levels (sequential quadratic programming): with the
/// gradients G, the multipliers λ of G λ ≈ x − y and W = I + Σ λ_i H_i, it minimizes ½ pᵀWp − (x − y)·p where f + Gᵀp = 0.
pub(in crate::geometry::surfaces) fn local_foot<const D: usize>(
    levels: &[&dyn LevelFunction<D>],
    x: &Vector<D>,
    start: &Vector<D>,
    reach: f64,
) -> Option<LocalFoot<D>> {
    let count = levels.len();
    let mut y = *start;
    let mut last = f64::INFINITY;
    let size = x.amax().max(start.amax()).max(reach);
    for _ in 0..MOST_ITERATIONS {
        let mut values = [0.0; D];
        let mut gradients = [Vector::<D>::zeros(); D];
        let mut hessians = [Hessian::<D>::zeros(); D];
        for (k, level) in levels.iter().enumerate() {
            let jet = level.jet(&y);
            (values[k], gradients[k], hessians[k]) = (jet.value, jet.gradient, jet.hessian);
        }
        let factors = Factors::new(&gradients[..count])?;
        let to_zero = factors.to_zero(&values[..count]);
        let offset = x - y;
        let multipliers = factors.multipliers(&offset);
        let mut stretch = Hessian::<D>::identity();
        for k in 0..count {
            stretch += hessians[k] * multipliers[k];
        }
        let tangents = factors.tangents();
        let residual = offset - stretch * to_zero;
        let (along, least) = tangential_step(&tangents[..D - count], &stretch, &residual);
        let mut step = to_zero + along;
        let length = step.norm();
        if !length.is_finite() {
            return None;
        }
        if length > reach {
            step *= reach / length;
        }
        y += step;
        let is_still = length <= ROUND_OFF * reach && length > 0.25 * last;
        if length <= 4.0 * f64::EPSILON * size || is_still {
            // Of a zero that is not simple Newton's method finds only a few digits, and slowly.
            let is_on = to_zero.norm() <= ON_ZERO * size;
            return is_on.then_some(LocalFoot { point: y, stretch: least, is_smooth: true });
        }
        if (y - start).norm() > FARTHEST * reach {
            return None;
        }
        last = length;
    }
    None
}

/// The point of the zero of a level that Newton's method along the gradient finds from a place within `reach`.
pub(in crate::geometry::surfaces) fn project<const D: usize>(
    level: &dyn LevelFunction<D>,
    start: &Vector<D>,
    reach: f64,
) -> Option<Vector<D>> {
    let mut y = *start;
    let size = start.amax().max(reach);
    let mut last = f64::INFINITY;
    for _ in 0..MOST_PROJECTIONS {
        let jet = level.jet(&y);
        let step = jet.gradient * (-jet.value / jet.gradient.norm_squared());
        let length = step.norm();
        if !length.is_finite() || (y - start).norm() > FARTHEST * reach {
            return None;
        }
        y += step * (reach / length).min(1.0);
        if length <= 4.0 * f64::EPSILON * size || (length <= ON_ZERO * size && length > 0.25 * last) {
            return Some(y);
        }
        last = length;
    }
    None
}

/// A nearest point by steps downhill on the zero of a level with kinks: each step goes along the tangent and back to the zero,
/// and is halved where it comes no nearer.
pub(in crate::geometry::surfaces) fn descend<const D: usize>(
    level: &dyn LevelFunction<D>,
    x: &Vector<D>,
    start: &Vector<D>,
    reach: f64,
) -> LocalFoot<D> {
    let mut y = *start;
    let mut share = 1.0;
    for _ in 0..4 * MOST_ITERATIONS {
        let normal = level.jet(&y).normal();
        let offset = x - y;
        let mut along = offset - normal * normal.dot(&offset);
        if along.norm() * share <= f64::EPSILON * x.amax().max(reach) || !along.norm().is_finite() {
            break;
        }
        along *= share * (reach / along.norm()).min(1.0);
        match project(level, &(y + along), reach) {
            Some(next) if (x - next).norm() < offset.norm() => {
                y = next;
                share = (2.0 * share).min(1.0);
            }
            _ => share *= 0.5,
        }
    }
    let normal = level.jet(&y).normal();
    let offset = x - y;
    let rest = (offset - normal * normal.dot(&offset)).norm();
    LocalFoot { point: y, stretch: f64::NAN, is_smooth: rest <= SMOOTH * offset.norm().max(f64::EPSILON) }
}
