//! The closest point on the zero of a local polynomial by a safeguarded Newton method (PCP eqs. 10 to 14).
//!
//! Splitting the Newton system of the Lagrangian into the normal n = ∇p/|∇p| and the tangent plane gives a normal
//! step −p/|∇p| and a tangential step with the reduced Hessian I + λ tᵢ·∇∇p·tⱼ, λ the least-squares multiplier. The
//! reduced Hessian's pivots are held above a floor and the step's length below a share of the support, so the
//! iteration cannot run off; near the solution both bounds are inactive and convergence is quadratic.

use super::method::PcpMethod;
use crate::geometry::Vector;
use crate::linear_algebra::number::{LANES, Lanes, Number, add_scaled, difference, dot, multiply_symmetric};
use crate::polynomials::horner::derivatives;
use crate::polynomials::{Fit, Jet};

/// A local polynomial of the level set with the point of its zero where iterations start.
#[derive(Debug, Clone, Copy)]
pub struct Patch<'a, const D: usize> {
    /// Geometry of the fit.
    pub fit: &'a Fit<D>,
    /// Total degree that the coefficients are laid out for.
    pub degree: usize,
    /// Coefficients of monomials in nested order.
    pub coefficients: &'a [f64],
    /// A point with p = 0.
    pub start: &'a Vector<D>,
    /// p, ∇p, ∇∇p there.
    pub jet: &'a Jet<f64, D>,
}

/// How an iteration ended.
#[derive(Debug, Clone, Copy)]
pub enum NewtonEnd<const D: usize> {
    /// A stationary point of the distance on p = 0.
    Converged(FootPoint<D>),
    /// The iterate left the support of the fit; another sample may know more there.
    LeftSupport(Vector<D>),
    /// The iteration did not settle.
    Stuck,
}

/// A closest point with what the polynomial says there.
#[derive(Debug, Clone, Copy)]
pub struct FootPoint<const D: usize> {
    /// The point.
    pub point: Vector<D>,
    /// ∇p/|∇p|.
    pub normal: Vector<D>,
    /// ∇·n.
    pub curvature: f64,
}

/// Least pivot of the reduced Hessian; 1 is a plane, 0 the center of curvature.
const PIVOT_FLOOR: f64 = 0.1;
/// Longest step as a share of the support's radius.
pub(super) const LONGEST_STEP: f64 = 0.4;
/// A stalled end is accepted when the last step is shorter than this share of the support.
pub(super) const ACCEPTED: f64 = 1e-7;
/// A step shorter than this share of the support, and than a hundredth of the one before, is the last: convergence is
/// quadratic, so the next would be shorter than its square.
const QUADRATIC: f64 = 3e-8;
/// See [`QUADRATIC`].
const QUADRATIC_RATIO: f64 = 1e-2;

/// Watches whether steps still become shorter: an iteration that runs in a circle would burn all that are allowed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Progress {
    shortest: f64,
    since: u32,
}

impl Default for Progress {
    fn default() -> Self {
        Self { shortest: f64::INFINITY, since: 0 }
    }
}

/// Iterations without a shorter step than before that are too many.
const STAGNANT: u32 = 30;

impl Progress {
    /// Takes the length of a step into account.
    #[inline(always)]
    pub(super) fn is_stuck(&mut self, length: f64) -> bool {
        self.since = if length < self.shortest { 0 } else { self.since + 1 };
        self.shortest = self.shortest.min(length);
        self.since > STAGNANT
    }
}

/// Whether the iteration ends with a step of this length.
#[inline(always)]
pub(super) fn is_last_step(method: &PcpMethod, length: f64, last: f64, radius: f64, largest_coordinate: f64) -> bool {
    let is_quadratic = length <= QUADRATIC * radius && length <= QUADRATIC_RATIO * last;
    let is_stalled = length <= ACCEPTED * radius && length >= 0.5 * last;
    // Coordinates cannot move by less than their own last bit.
    length <= method.tolerance || is_quadratic || is_stalled || length <= f64::EPSILON * largest_coordinate
}

/// Finds the points of p = 0 nearest to up to [`LANES`] queries, all beginning at the patch's start. Returns the end of
/// each and the iterations made.
#[must_use]
#[inline]
pub fn closest_points<const D: usize>(
    method: &PcpMethod,
    patch: &Patch<D>,
    queries: &[Vector<D>],
) -> ([NewtonEnd<D>; LANES], u64) {
    let fit = patch.fit;
    let mut ends = [NewtonEnd::Stuck; LANES];
    let count = queries.len().min(LANES);
    let mut active = [false; LANES];
    active[..count].fill(true);
    let zero = Lanes::splat(0.0);
    let (mut query, mut x, mut middle, mut center) = ([zero; D], [zero; D], [zero; D], [zero; D]);
    for d in 0..D {
        let mut lanes = [queries[0][d]; LANES];
        for lane in 1..count {
            lanes[lane] = queries[lane][d];
        }
        query[d] = Lanes::new(lanes);
        x[d] = Lanes::splat(patch.start[d]);
        middle[d] = Lanes::splat(fit.middle[d]);
        center[d] = Lanes::splat(fit.center[d]);
    }
    let mut jet = Jet {
        value: Lanes::splat(patch.jet.value),
        gradient: patch.jet.gradient.map(Lanes::splat),
        hessian: patch.jet.hessian.map(|row| row.map(Lanes::splat)),
    };
    let inverse_scale = 1.0 / fit.scale;
    let most = Lanes::splat(LONGEST_STEP * fit.radius);
    let limit = fit.radius * fit.radius;
    let mut last = [f64::INFINITY; LANES];
    let mut progress = [Progress::default(); LANES];
    let mut iterations = 0;
    for iteration in 1..=method.max_iterations {
        let offset = difference(&query, &x);
        let step = newton_step(&jet, &offset);
        let length = dot(&step, &step).sqrt();
        let lengths = length.to_array();
        let mut largest = x[0].abs();
        for component in &x[1..] {
            largest = largest.max(component.abs());
        }
        let largest = largest.to_array();
        let factor = most / Number::max(length, most);
        let next = add_scaled(&x, factor, &step);
        let from_middle = difference(&next, &middle);
        let away = dot(&from_middle, &from_middle).to_array();
        let mut done = [false; LANES];
        let mut any_done = false;
        let mut any_active = false;
        for lane in 0..LANES {
            if !active[lane] {
                continue;
            }
            iterations += 1;
            if !lengths[lane].is_finite() {
                // The gradient vanished or numbers ran over: the end stays `Stuck`.
                active[lane] = false;
            } else if is_last_step(method, lengths[lane], last[lane], fit.radius, largest[lane]) {
                done[lane] = true;
                any_done = true;
                active[lane] = false;
            } else if progress[lane].is_stuck(lengths[lane]) {
                active[lane] = false;
            } else if away[lane] > limit {
                ends[lane] = NewtonEnd::LeftSupport(Vector::<D>::from_fn(|d, _| next[d].to_array()[lane]));
                active[lane] = false;
            }
            any_active |= active[lane];
        }
        if any_done {
            // The jet is at most one last step away: its quadratic part tells the normal there.
            let jet = jet.translated(&step);
            let foot = add_scaled(&x, Lanes::splat(1.0), &step);
            let (normal, curvature) = (jet.normal(), jet.curvature().to_array());
            for lane in (0..LANES).filter(|lane| done[*lane]) {
                ends[lane] = NewtonEnd::Converged(FootPoint {
                    point: Vector::<D>::from_fn(|d, _| foot[d].to_array()[lane]),
                    normal: Vector::<D>::from_fn(|d, _| normal[d].to_array()[lane]),
                    curvature: curvature[lane],
                });
            }
        }
        if !any_active || iteration == method.max_iterations {
            break;
        }
        x = next;
        last = lengths;
        let t = difference(&x, &center).map(|c| c * Lanes::splat(inverse_scale));
        let local = derivatives(patch.degree, |place| Lanes::splat(patch.coefficients[place]), &t);
        jet = Jet::from_local(&local, Lanes::splat(inverse_scale));
    }
    (ends, iterations)
}

/// One step for the offset `query − x`; not finite where the gradient vanishes.
#[inline(always)]
pub(super) fn newton_step<T: Number, const D: usize>(jet: &Jet<T, D>, offset: &[T; D]) -> [T; D] {
    let floor = T::splat(PIVOT_FLOOR);
    let one = T::splat(1.0);
    let inverse = one / jet.slope();
    let n = jet.gradient.map(|g| g * inverse);
    // x − query + λ∇p = 0 in the least-squares sense.
    let lambda = dot(offset, &n) * inverse;
    let along = -(jet.value * inverse);
    let step = n.map(|c| c * along);
    // What is left to slide after the normal step: the offset less (I + λ∇∇p) times that step.
    let bend = multiply_symmetric(&jet.hessian, &step);
    let pull = add_scaled(&difference(offset, &step), -lambda, &bend);
    let (s, t) = tangents(&n);
    let bent = multiply_symmetric(&jet.hessian, &s);
    let first = Number::max(lambda.mul_add(dot(&s, &bent), one), floor);
    let mut slide = dot(&s, &pull) / first;
    if D == 3 {
        let factor = lambda * dot(&t, &bent) / first;
        let diagonal = lambda.mul_add(dot(&t, &multiply_symmetric(&jet.hessian, &t)), one);
        let second = Number::max(diagonal - factor * factor * first, floor);
        let other = (dot(&t, &pull) - factor * first * slide) / second;
        slide = slide - factor * other;
        let across = add_scaled(&step, other, &t);
        return add_scaled(&across, slide, &s);
    }
    add_scaled(&step, slide, &s)
}

/// Unit vectors that span the plane across the unit normal n without a case distinction (Duff et al. 2017); the second
/// is zero in two dimensions.
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
        // p = z + (a x² + b y²)/2 at the origin, query (u, v, w): slides of u/(1 + w a), v/(1 + w b).
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
