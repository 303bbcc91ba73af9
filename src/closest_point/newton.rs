//! The closest point on the zero of a local polynomial p by a safeguarded Newton method (PCP eqs. 10 to 14).
//!
//! The Newton system of the Lagrangian splits into a part along the normal n = ∇p/‖∇p‖ and one in the tangent plane.
//! The normal step is −p/‖∇p‖. The tangential step has the reduced Hessian I + λ tᵢ·∇∇p·tⱼ with the least-squares
//! multiplier λ (docs/errata.md, PCP 12). The pivots of the reduced Hessian stay above a floor, and a step is at most a
//! fraction of the support, so that the iteration cannot diverge. Near the solution both bounds are inactive and
//! convergence is quadratic.

use super::method::PcpMethod;
use crate::geometry::Vector;
use crate::linear_algebra::number::{LANES, Lanes, Number, add_scaled, difference, dot, multiply_symmetric};
use crate::polynomials::horner::derivatives;
use crate::polynomials::{Fit, Jet};

/// A local polynomial of the level set with the point of its zero from which iterations start.
#[derive(Debug, Clone, Copy)]
pub struct Patch<'a, const D: usize> {
    /// Geometry of the fit.
    pub fit: &'a Fit<D>,
    /// Total degree that the coefficients are laid out for.
    pub degree: usize,
    /// Coefficients of the monomials in nested order.
    pub coefficients: &'a [f64],
    /// A point with p = 0, where iterations start.
    pub start: &'a Vector<D>,
    /// Value, gradient and Hessian at the start.
    pub jet: &'a Jet<f64, D>,
}

/// Result of a Newton iteration.
#[derive(Debug, Clone, Copy)]
pub enum NewtonEnd<const D: usize> {
    /// A stationary point of the distance on p = 0 was found.
    Converged(FootPoint<D>),
    /// The iterate left the support of the fit at this position, where another sample's polynomial is valid.
    LeftSupport(Vector<D>),
    /// The iteration did not converge.
    Stuck,
}

/// A closest point on p = 0 with the geometry there.
#[derive(Debug, Clone, Copy)]
pub struct FootPoint<const D: usize> {
    /// The closest point.
    pub point: Vector<D>,
    /// Unit normal ∇p/‖∇p‖.
    pub normal: Vector<D>,
    /// Curvature ∇·n.
    pub curvature: f64,
}

/// Smallest pivot of the reduced Hessian, which is 1 for a plane and 0 at a center of curvature.
const PIVOT_FLOOR: f64 = 0.1;
/// Longest step, as a fraction of the support's radius.
pub(super) const LONGEST_STEP: f64 = 0.4;
/// A stalled iteration has converged when its last step is shorter than this fraction of the support's radius.
pub(super) const ACCEPTED: f64 = 1e-7;
/// A step is the last one when it is shorter than this fraction of the support's radius and than [`QUADRATIC_RATIO`] of
/// the step before. Convergence is then quadratic, and the next step would be shorter than the square of this one.
const QUADRATIC: f64 = 3e-8;
/// See [`QUADRATIC`].
const QUADRATIC_RATIO: f64 = 1e-2;

/// Watches whether steps still get shorter. An iteration that cycles would otherwise use up all allowed iterations.
#[derive(Debug, Clone, Copy)]
pub(super) struct Progress {
    /// Length of the shortest step so far.
    shortest: f64,
    /// Number of steps since then.
    since: u32,
}

impl Default for Progress {
    fn default() -> Self {
        Self { shortest: f64::INFINITY, since: 0 }
    }
}

/// Largest number of iterations without a step that is shorter than all before it.
const STAGNANT: u32 = 30;

impl Progress {
    /// Takes the length of a step into account, and returns whether the iteration no longer makes progress.
    #[inline(always)]
    pub(super) fn is_stuck(&mut self, length: f64) -> bool {
        self.since = if length < self.shortest { 0 } else { self.since + 1 };
        self.shortest = self.shortest.min(length);
        self.since > STAGNANT
    }
}

/// Whether the iteration has converged with a step of the given length.
///
/// - `last`: length of the step before.
/// - `radius`: radius of the support.
/// - `largest_coordinate`: largest coordinate of the point, in magnitude.
#[inline(always)]
pub(super) fn is_last_step(method: &PcpMethod, length: f64, last: f64, radius: f64, largest_coordinate: f64) -> bool {
    let is_quadratic = length <= QUADRATIC * radius && length <= QUADRATIC_RATIO * last;
    let is_stalled = length <= ACCEPTED * radius && length >= 0.5 * last;
    // Coordinates cannot change by less than their last bit.
    length <= method.tolerance || is_quadratic || is_stalled || length <= f64::EPSILON * largest_coordinate
}

/// Finds the points of p = 0 that are nearest to up to [`LANES`] queries, one query per lane.
///
/// - `patch`: the polynomial and the point where all iterations start.
/// - `queries`: at least one query, in the frame of the patch.
///
/// Returns the result of each query and the number of iterations of all of them.
#[must_use]
#[inline]
pub fn closest_points<const D: usize>(
    method: &PcpMethod,
    patch: &Patch<D>,
    queries: &[Vector<D>],
) -> ([NewtonEnd<D>; LANES], u64) {
    let fit = patch.fit;
    let query = transpose(queries);
    let [mut x, middle, center] = [patch.start, &fit.middle, &fit.center].map(splat);
    let mut jet = Jet {
        value: Lanes::splat(patch.jet.value),
        gradient: patch.jet.gradient.map(Lanes::splat),
        hessian: patch.jet.hessian.map(|row| row.map(Lanes::splat)),
    };
    let inverse_scale = 1.0 / fit.scale;
    let longest = Lanes::splat(LONGEST_STEP * fit.radius);
    let mut iterations = LaneIterations::new(queries.len());
    for iteration in 1..=method.max_iterations {
        let step = newton_step(&jet, &difference(&query, &x));
        let length = dot(&step, &step).sqrt();
        let next = add_scaled(&x, longest / Number::max(length, longest), &step);
        let from_middle = difference(&next, &middle);
        let lengths = length.to_array();
        let squares = dot(&from_middle, &from_middle).to_array();
        let converged = iterations.judge(method, fit, &lengths, &largest_coordinates(&x), (&next, &squares));
        if converged.contains(&true) {
            iterations.store(&converged, &x, &step, &jet);
        }
        if !iterations.is_active.contains(&true) || iteration == method.max_iterations {
            break;
        }
        x = next;
        iterations.last = lengths;
        let t = difference(&x, &center).map(|c| c * Lanes::splat(inverse_scale));
        let local = derivatives(patch.degree, |place| Lanes::splat(patch.coefficients[place]), &t);
        jet = Jet::from_local(&local, Lanes::splat(inverse_scale));
    }
    (iterations.ends, iterations.count)
}

/// State of the iterations of all lanes.
struct LaneIterations<const D: usize> {
    /// Results of the lanes whose iterations have ended.
    ends: [NewtonEnd<D>; LANES],
    /// Whether the iteration of a lane goes on.
    is_active: [bool; LANES],
    /// Length of the last step of each lane.
    last: [f64; LANES],
    progress: [Progress; LANES],
    /// Number of iterations of all lanes.
    count: u64,
}

impl<const D: usize> LaneIterations<D> {
    #[inline(always)]
    fn new(queries: usize) -> Self {
        Self {
            ends: [NewtonEnd::Stuck; LANES],
            is_active: std::array::from_fn(|lane| lane < queries),
            last: [f64::INFINITY; LANES],
            progress: [Progress::default(); LANES],
            count: 0,
        }
    }

    /// Ends the iterations that this step completes, and returns which of them have converged.
    ///
    /// - `lengths`: length of the step of each lane.
    /// - `largest`: largest coordinate of each lane, in magnitude.
    /// - `next`: the next positions, and their squared distances from the middle of the support.
    #[inline(always)]
    fn judge(
        &mut self,
        method: &PcpMethod,
        fit: &Fit<D>,
        lengths: &[f64; LANES],
        largest: &[f64; LANES],
        (next, squares): (&[Lanes; D], &[f64; LANES]),
    ) -> [bool; LANES] {
        let limit = fit.radius * fit.radius;
        let mut converged = [false; LANES];
        for lane in 0..LANES {
            if !self.is_active[lane] {
                continue;
            }
            self.count += 1;
            if !lengths[lane].is_finite() {
                // The gradient vanished or numbers overflowed: the result stays `Stuck`.
                self.is_active[lane] = false;
            } else if is_last_step(method, lengths[lane], self.last[lane], fit.radius, largest[lane]) {
                converged[lane] = true;
                self.is_active[lane] = false;
            } else if self.progress[lane].is_stuck(lengths[lane]) {
                self.is_active[lane] = false;
            } else if squares[lane] > limit {
                self.ends[lane] = NewtonEnd::LeftSupport(of_lane(next, lane));
                self.is_active[lane] = false;
            }
        }
        converged
    }

    /// Stores the foot points of the converged lanes. They are one last step away from `x`, where the jet was
    /// evaluated.
    #[inline(always)]
    fn store(&mut self, converged: &[bool; LANES], x: &[Lanes; D], step: &[Lanes; D], jet: &Jet<Lanes, D>) {
        let jet = jet.translated(step);
        let foot = add_scaled(x, Lanes::splat(1.0), step);
        let (normal, curvature) = (jet.normal(), jet.curvature().to_array());
        for lane in (0..LANES).filter(|lane| converged[*lane]) {
            let (point, normal) = (of_lane(&foot, lane), of_lane(&normal, lane));
            self.ends[lane] = NewtonEnd::Converged(FootPoint { point, normal, curvature: curvature[lane] });
        }
    }
}

/// Up to [`LANES`] vectors, one per lane. Spare lanes repeat the first vector.
#[inline(always)]
fn transpose<const D: usize>(vectors: &[Vector<D>]) -> [Lanes; D] {
    std::array::from_fn(|d| {
        Lanes::new(std::array::from_fn(|lane| vectors[if lane < vectors.len() { lane } else { 0 }][d]))
    })
}

/// The same vector in every lane.
#[inline(always)]
fn splat<const D: usize>(vector: &Vector<D>) -> [Lanes; D] {
    std::array::from_fn(|d| Lanes::splat(vector[d]))
}

/// The vector of one lane.
#[inline(always)]
fn of_lane<const D: usize>(vectors: &[Lanes; D], lane: usize) -> Vector<D> {
    Vector::<D>::from_fn(|d, _| vectors[d].to_array()[lane])
}

/// Largest coordinate of each lane, in magnitude.
#[inline(always)]
fn largest_coordinates<const D: usize>(x: &[Lanes; D]) -> [f64; LANES] {
    let mut largest = x[0].abs();
    for component in &x[1..] {
        largest = largest.max(component.abs());
    }
    largest.to_array()
}

/// The Newton step at a point for the offset `query − x`. It is not finite where the gradient vanishes.
///
/// With the unit normal n and the multiplier λ = offset·n/‖∇p‖, the normal step is −p/‖∇p‖ n. The tangential step
/// solves the reduced system with the matrix tᵢ·(I + λ∇∇p)·tⱼ, whose pivots are at least [`PIVOT_FLOOR`].
#[inline(always)]
pub(super) fn newton_step<T: Number, const D: usize>(jet: &Jet<T, D>, offset: &[T; D]) -> [T; D] {
    let floor = T::splat(PIVOT_FLOOR);
    let one = T::splat(1.0);
    let inverse = one / jet.slope();
    let n = jet.gradient.map(|g| g * inverse);
    // x − query + λ∇p = 0 in the least-squares sense.
    let lambda = dot(offset, &n) * inverse;
    let normal_length = -(jet.value * inverse);
    let step = n.map(|c| c * normal_length);
    // Residual of the tangential equations: the offset minus (I + λ∇∇p) times the normal step.
    let hessian_step = multiply_symmetric(&jet.hessian, &step);
    let residual = add_scaled(&difference(offset, &step), -lambda, &hessian_step);
    let (s, t) = tangents(&n);
    let hessian_s = multiply_symmetric(&jet.hessian, &s);
    let first_pivot = Number::max(lambda.mul_add(dot(&s, &hessian_s), one), floor);
    let mut along_s = dot(&s, &residual) / first_pivot;
    if D == 3 {
        let factor = lambda * dot(&t, &hessian_s) / first_pivot;
        let diagonal = lambda.mul_add(dot(&t, &multiply_symmetric(&jet.hessian, &t)), one);
        let second_pivot = Number::max(diagonal - factor * factor * first_pivot, floor);
        let along_t = (dot(&t, &residual) - factor * first_pivot * along_s) / second_pivot;
        along_s = along_s - factor * along_t;
        let step = add_scaled(&step, along_t, &t);
        return add_scaled(&step, along_s, &s);
    }
    add_scaled(&step, along_s, &s)
}

/// Unit vectors that span the tangent plane of the unit normal n, without branches (Duff 2017). The second one is zero
/// in two dimensions.
#[inline(always)]
pub(super) fn tangents<T: Number, const D: usize>(n: &[T; D]) -> ([T; D], [T; D]) {
    let zero = T::splat(0.0);
    let (mut s, mut t) = ([zero; D], [zero; D]);
    if D == 2 {
        s[0] = -n[1];
        s[1] = n[0];
    } else {
        let one = T::splat(1.0);
        let sign = Number::copysign(one, n[2]);
        let a = -(one / (sign + n[2]));
        let b = n[0] * n[1] * a;
        s[0] = (sign * n[0] * n[0]).mul_add(a, one);
        s[1] = sign * b;
        s[2] = -(sign * n[0]);
        t[0] = b;
        t[1] = (n[1] * n[1]).mul_add(a, sign);
        t[2] = -n[1];
    }
    (s, t)
}

#[cfg(test)]
mod tests {
    use super::{newton_step, tangents};
    use crate::geometry::random::CounterRandom;
    use crate::linear_algebra::number::dot;
    use crate::polynomials::Jet;

    #[test]
    fn tangents_are_orthonormal_for_every_normal() {
        let random = CounterRandom::new(2);
        for k in 0..1000 {
            let mut n: [f64; 3] = std::array::from_fn(|d| random.symmetric(&[k, d as i64]));
            if k == 0 {
                n = [0.0, 0.0, -1.0];
            }
            let size = dot(&n, &n).sqrt();
            let n = n.map(|c| c / size);
            let (s, t) = tangents(&n);
            for (a, b, expected) in [(s, s, 1.0), (t, t, 1.0), (s, t, 0.0), (s, n, 0.0), (t, n, 0.0)] {
                assert!((dot(&a, &b) - expected).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn one_step_from_the_pole_of_a_paraboloid_is_newtons() {
        // p = z + (a x² + b y²)/2 at the origin and the query (u, v, w) give the tangential steps u/(1 + w a) and v/(1
        // + w b).
        let (a, b) = (0.7, -0.4);
        let jet =
            Jet { value: 0.0, gradient: [0.0, 0.0, 1.0], hessian: [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, 0.0]] };
        let step = newton_step(&jet, &[0.3, -0.2, 0.5]);
        let expected = [0.3 / (1.0 + 0.5 * a), -0.2 / (1.0 + 0.5 * b), 0.0];
        for d in 0..3 {
            assert!((step[d] - expected[d]).abs() < 1e-15);
        }
        // Beyond the center of curvature the pivot is held above its floor.
        let far = newton_step(&jet, &[0.0, 0.01, 5.0]);
        assert!((far[1] - 0.1).abs() < 1e-15);
    }
}
