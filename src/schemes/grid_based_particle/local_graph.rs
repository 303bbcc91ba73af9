//! A front as the graph of polynomials over a tangent plane (GBPM 3.3.1): f(s), s of M coordinates, one polynomial for each
//! of the D − M directions across, all lengths in spacings.

use crate::linear_algebra::least_squares::LeastSquares;
use crate::polynomials::MultiIndexSet;

/// The highest degree of a local polynomial.
pub(super) const MOST_DEGREE: usize = 4;
/// Number of terms of a polynomial of two variables of that degree.
const MOST_TERMS: usize = 15;
/// Directions across a front at most: of a curve in space two.
pub(super) const MOST_ACROSS: usize = 2;
/// What a point has beside its coordinates: heights over the tangent plane, and the parameter.
const QUANTITIES: usize = MOST_ACROSS + 1;
/// Which of these is the parameter along the front.
pub(super) const PARAMETER: usize = MOST_ACROSS;
/// Coordinates along the tangent plane, and what is fitted over it.
pub(super) type LocalPoint<const M: usize> = ([f64; M], [f64; QUANTITIES]);

/// Tuning constants of fits and of Newton's iteration to a closest point. Lengths are in spacings.
struct GraphTuning {
    /// Largest number of Newton steps.
    most_iterations: usize,
    /// Longest Newton step.
    longest_step: f64,
    /// Length of a Newton step that changes nothing.
    still: f64,
    /// Length of the last Newton step below which the closest point counts as found.
    found: f64,
    /// Least pivot of a Hessian that counts as positive definite.
    least_pivot: f64,
    /// Largest condition of a fit with scaled columns; evenly spread points have 10 to 100.
    worst_condition: f64,
}

const TUNING: GraphTuning = GraphTuning {
    most_iterations: 30,
    longest_step: 0.5,
    still: 1e-15,
    found: 1e-9,
    least_pivot: 1e-3,
    worst_condition: 1e3,
};

/// The monomials of a local polynomial, by their exponents.
#[derive(Debug, Clone)]
pub(super) struct Terms<const M: usize> {
    indices: Vec<[u8; M]>,
}

/// Value, slopes and second derivatives of a local polynomial at one point.
#[derive(Debug, Clone, Copy)]
pub(super) struct GraphJet<const M: usize> {
    pub value: f64,
    pub first: [f64; M],
    pub second: [[f64; M]; M],
}

/// The points, weights and slopes of a least-squares fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct FitData<'a, const M: usize> {
    /// Points s_j with the quantities there.
    pub points: &'a [LocalPoint<M>],
    /// k of the weights exp(−k |s_j|²).
    pub weight: f64,
    /// Slopes asked for at the points, None where the front is too steep; empty where none are asked for.
    pub slopes: &'a [Option<[f64; M]>],
    /// λ: slopes count with λ² times the weight of the quantities.
    pub slope_weight: f64,
}

/// A local polynomial f: its terms and their coefficients.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalGraph<'a, const M: usize> {
    terms: &'a Terms<M>,
    coefficients: [f64; MOST_TERMS],
}

impl<const M: usize> Terms<M> {
    pub fn new(degree: usize) -> Self {
        let set = MultiIndexSet::<M>::total_degree(degree.min(MOST_DEGREE));
        Self { indices: set.indices().to_vec() }
    }

    pub fn count(&self) -> usize {
        self.indices.len()
    }

    /// The graph that is zero everywhere.
    pub fn nothing(&self) -> LocalGraph<'_, M> {
        LocalGraph { terms: self, coefficients: [0.0; MOST_TERMS] }
    }

    /// The least-squares fit to one quantity; None where the points do not determine it.
    pub fn fit(&self, data: &FitData<'_, M>, quantity: usize, squares: &mut LeastSquares) -> Option<LocalGraph<'_, M>> {
        let &FitData { points, weight, slopes, slope_weight } = data;
        let n = self.count();
        if points.len() < n {
            return None;
        }
        squares.reset(points.len() + M * slopes.len(), n);
        let mut row = [0.0; MOST_TERMS];
        for (j, (s, quantities)) in points.iter().enumerate() {
            let square: f64 = s.iter().map(|s| s * s).sum();
            let root = (-0.5 * weight * square).exp();
            let powers = powers(s);
            for (value, index) in row.iter_mut().zip(&self.indices) {
                *value = root * product(&powers, index);
            }
            squares.set_row(j, &row[..n], root * quantities[quantity]);
            let Some(slope) = slopes.get(j) else { continue };
            // A row of zeros asks for nothing.
            let (root, slope) = slope.map_or((0.0, [0.0; M]), |slope| (slope_weight * root, slope));
            for (a, slope) in slope.iter().enumerate() {
                for (value, index) in row.iter_mut().zip(&self.indices) {
                    let term = lowered(index, a).map(|(factor, lower)| factor * product(&powers, &lower));
                    *value = root * term.unwrap_or(0.0);
                }
                squares.set_row(points.len() + M * j + a, &row[..n], root * slope);
            }
        }
        let (found, solution) = squares.solve();
        if found.rank < n || found.condition > TUNING.worst_condition {
            return None;
        }
        let mut coefficients = [0.0; MOST_TERMS];
        coefficients[..n].copy_from_slice(solution);
        Some(LocalGraph { terms: self, coefficients })
    }
}

/// The powers s_d^k of each coordinate, k up to the highest degree.
fn powers<const M: usize>(s: &[f64; M]) -> [[f64; MOST_DEGREE + 1]; M] {
    s.map(|s| {
        let mut powers = [1.0; MOST_DEGREE + 1];
        for k in 1..=MOST_DEGREE {
            powers[k] = powers[k - 1] * s;
        }
        powers
    })
}

fn product<const M: usize>(powers: &[[f64; MOST_DEGREE + 1]; M], index: &[u8; M]) -> f64 {
    powers.iter().zip(index).map(|(powers, k)| powers[usize::from(*k)]).product()
}

impl<const M: usize> LocalGraph<'_, M> {
    /// Value and first and second derivatives of f at s.
    pub fn jet(&self, s: &[f64; M]) -> GraphJet<M> {
        let powers = powers(s);
        let mut jet = GraphJet { value: 0.0, first: [0.0; M], second: [[0.0; M]; M] };
        for (c, index) in self.coefficients.iter().zip(&self.terms.indices) {
            jet.value += c * product(&powers, index);
            for a in 0..M {
                let Some((factor, lower)) = lowered(index, a) else { continue };
                jet.first[a] += c * factor * product(&powers, &lower);
                for b in 0..=a {
                    if let Some((again, lowest)) = lowered(&lower, b) {
                        jet.second[a][b] += c * factor * again * product(&powers, &lowest);
                    }
                }
            }
        }
        for a in 0..M {
            for b in a + 1..M {
                jet.second[a][b] = jet.second[b][a];
            }
        }
        jet
    }
}

/// The closest point of the graph of C polynomials to (p, heights), searched from `start`: Newton's iteration for
/// d(s) = ½ |s − p|² + ½ Σ (f(s) − height)² (GBPM eq. 4), with the Hessian without its indefinite part where that
/// leads uphill. None where it does not settle.
pub(super) fn closest<const M: usize, const C: usize>(
    graphs: &[LocalGraph<'_, M>; C],
    p: &[f64; M],
    heights: &[f64; C],
    start: [f64; M],
) -> Option<([f64; M], [GraphJet<M>; C])> {
    let jets = |s: &[f64; M]| -> [GraphJet<M>; C] { std::array::from_fn(|c| graphs[c].jet(s)) };
    let mut s = start;
    let mut found = jets(&s);
    let mut last = f64::INFINITY;
    for _ in 0..TUNING.most_iterations {
        let mut gradient: [f64; M] = std::array::from_fn(|a| s[a] - p[a]);
        let mut hessian = [[[0.0; M]; M]; 2];
        for (bend, hessian) in [1.0, 0.0].into_iter().zip(&mut hessian) {
            for (a, row) in hessian.iter_mut().enumerate() {
                row[a] = 1.0;
                for (b, entry) in row.iter_mut().enumerate() {
                    for (jet, height) in found.iter().zip(heights) {
                        let rest = bend * (jet.value - height);
                        *entry += jet.first[a] * jet.first[b] + rest * jet.second[a][b];
                    }
                }
            }
        }
        for (jet, height) in found.iter().zip(heights) {
            for (a, gradient) in gradient.iter_mut().enumerate() {
                *gradient += (jet.value - height) * jet.first[a];
            }
        }
        let step = solve_positive(&hessian[0], &gradient).or_else(|| solve_positive(&hessian[1], &gradient))?;
        let length = step.iter().map(|s| s * s).sum::<f64>().sqrt();
        let scale = if length > TUNING.longest_step { TUNING.longest_step / length } else { 1.0 };
        for (s, step) in s.iter_mut().zip(step) {
            *s -= scale * step;
        }
        found = jets(&s);
        // At round-off steps stop shrinking.
        if length <= TUNING.still || (length <= TUNING.found && length >= 0.5 * last) {
            return Some((s, found));
        }
        last = length;
    }
    (last <= TUNING.found).then_some((s, found))
}

/// The exponents of ∂_a of a monomial and its factor; None where the derivative vanishes.
fn lowered<const M: usize>(index: &[u8; M], a: usize) -> Option<(f64, [u8; M])> {
    let k = index[a];
    let mut lower = *index;
    lower[a] = k.checked_sub(1)?;
    Some((f64::from(k), lower))
}

/// The solution of a symmetric system of one or two equations, if it is clearly positive definite.
fn solve_positive<const M: usize>(matrix: &[[f64; M]; M], b: &[f64; M]) -> Option<[f64; M]> {
    let least = TUNING.least_pivot;
    let mut x = *b;
    let a = matrix[0][0];
    if a <= least {
        return None;
    }
    if M == 1 {
        x[0] = b[0] / a;
    } else {
        let (c, d) = (matrix[0][1], matrix[1][1]);
        let det = a * d - c * c;
        if d <= least || det <= least * a {
            return None;
        }
        x[0] = (d * b[0] - c * b[1]) / det;
        x[1] = (a * b[1] - c * b[0]) / det;
    }
    Some(x)
}

impl<const M: usize> GraphJet<M> {
    /// 1 + |∇f|², the square of the area element.
    fn stretch(&self) -> f64 {
        1.0 + self.first.iter().map(|f| f * f).sum::<f64>()
    }

    /// The upward unit normal, along the coordinates and up.
    pub fn normal(&self) -> ([f64; M], f64) {
        let inverse = 1.0 / self.stretch().sqrt();
        (self.first.map(|f| -f * inverse), inverse)
    }

    /// ∇·n of the upward normal: positive where the graph is a hill.
    pub fn curvature(&self) -> f64 {
        let stretch = self.stretch();
        let mut sum = 0.0;
        for a in 0..M {
            sum += stretch * self.second[a][a];
            for b in 0..M {
                sum -= self.first[a] * self.first[b] * self.second[a][b];
            }
        }
        -sum / (stretch * stretch.sqrt())
    }

    /// The product of the principal curvatures of a surface; zero of a curve.
    pub fn gauss_curvature(&self) -> f64 {
        if M == 1 {
            return 0.0;
        }
        let [first, .., last] = &self.second[..] else { return 0.0 };
        let det = first[0] * last[M - 1] - first[M - 1] * last[0];
        det / (self.stretch() * self.stretch())
    }

    /// The largest principal curvature by absolute value.
    pub fn sharpest(&self) -> f64 {
        let mean = 0.5 * self.curvature();
        if M == 1 {
            return 2.0 * mean.abs();
        }
        mean.abs() + (mean * mean - self.gauss_curvature()).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::{FitData, LocalPoint, Terms, closest};
    use crate::linear_algebra::least_squares::LeastSquares;

    /// A fit of heights alone.
    fn heights<const M: usize>(points: &[LocalPoint<M>], weight: f64) -> FitData<'_, M> {
        FitData { points, weight, slopes: &[], slope_weight: 0.0 }
    }

    /// A fit of heights and slopes.
    fn with_slopes<'a>(points: &'a [LocalPoint<2>], slopes: &'a [Option<[f64; 2]>]) -> FitData<'a, 2> {
        FitData { points, weight: 0.7, slopes, slope_weight: 0.1 }
    }

    #[test]
    fn a_polynomial_is_reproduced_with_its_curvatures() {
        let f = |x: f64, y: f64| 0.3 + 0.1 * x - 0.2 * y + 0.4 * x * x + 0.15 * x * y - 0.3 * y * y;
        let points: Vec<LocalPoint<2>> = (0..12)
            .map(|k| {
                let (x, y) = (f64::from(k % 4) - 1.3, f64::from(k / 4) - 0.8);
                ([x, y], [f(x, y), 0.0, 0.0])
            })
            .collect();
        let terms = Terms::<2>::new(2);
        let mut squares = LeastSquares::default();
        let graph = terms.fit(&heights(&points, 0.7), 0, &mut squares).unwrap();
        let jet = graph.jet(&[0.2, -0.1]);
        assert!((jet.value - f(0.2, -0.1)).abs() < 1e-13);
        assert!((jet.first[0] - (0.1 + 0.8 * 0.2 - 0.015)).abs() < 1e-13);
        assert!((jet.second[0][1] - 0.15).abs() < 1e-13 && (jet.second[1][0] - 0.15).abs() < 1e-13);
        // The definition of the mean curvature by differences of the normal.
        let e = 1e-5;
        let normal = |x: f64, y: f64| graph.jet(&[x, y]).normal().0;
        let divergence = (normal(0.2 + e, -0.1)[0] - normal(0.2 - e, -0.1)[0] + normal(0.2, -0.1 + e)[1]
            - normal(0.2, -0.1 - e)[1])
            / (2.0 * e);
        assert!((jet.curvature() - divergence).abs() < 1e-8);
        let det = jet.second[0][0] * jet.second[1][1] - 0.15 * 0.15;
        assert!(
            (jet.gauss_curvature() - det / (1.0 + jet.first[0].powi(2) + jet.first[1].powi(2)).powi(2)).abs() < 1e-13
        );
    }

    #[test]
    fn slopes_determine_what_heights_on_a_line_do_not() {
        let f = |x: f64, y: f64| 0.3 + 0.1 * x - 0.2 * y + 0.4 * x * x + 0.15 * x * y - 0.3 * y * y;
        let (points, slopes): (Vec<LocalPoint<2>>, Vec<_>) = (0..6)
            .map(|k| (0.5 * f64::from(k) - 1.2, 0.3))
            .map(|(x, y)| (([x, y], [f(x, y), 0.0, 0.0]), Some([0.1 + 0.8 * x + 0.15 * y, -0.2 + 0.15 * x - 0.6 * y])))
            .unzip();
        let terms = Terms::<2>::new(2);
        let mut squares = LeastSquares::default();
        assert!(terms.fit(&heights(&points, 0.7), 0, &mut squares).is_none());
        // −.3 y² is seen by no height and no slope along y alone.
        assert!(terms.fit(&with_slopes(&points, &slopes), 0, &mut squares).is_none());
        let aside = ([0.4, -0.5], [f(0.4, -0.5), 0.0, 0.0]);
        let points: Vec<_> = points.into_iter().chain([aside]).collect();
        let slopes: Vec<_> = slopes.into_iter().chain([None]).collect();
        let graph = terms.fit(&with_slopes(&points, &slopes), 0, &mut squares).unwrap();
        assert!((graph.jet(&[0.2, -0.1]).value - f(0.2, -0.1)).abs() < 1e-13);
        assert!((graph.jet(&[0.2, -0.1]).second[1][1] + 0.6).abs() < 1e-12);
    }

    #[test]
    fn the_closest_point_is_across_the_graph() {
        let points: Vec<LocalPoint<1>> = (0..8)
            .map(|k| f64::from(k) * 0.5 - 1.8)
            .map(|x| ([x], [(9.0 - x * x).sqrt() - 3.0, 0.3 * x, 0.0]))
            .collect();
        let terms = Terms::<1>::new(4);
        let mut squares = LeastSquares::default();
        let graph = terms.fit(&heights(&points, 1.0), 0, &mut squares).unwrap();
        for (p, height) in [(0.4, 1.0), (-0.6, -1.1), (0.0, 0.3)] {
            let (s, [jet]) = closest(&[graph], &[p], &[height], [0.0]).unwrap();
            assert!((s[0] - p + (jet.value - height) * jet.first[0]).abs() < 1e-13);
            // On a circle of radius 3 about (0, −3).
            let (x, y) = (s[0], jet.value + 3.0);
            assert!((x * (height + 3.0) - y * p).abs() < 3e-3, "{p} {height}");
            assert!((jet.curvature() - 1.0 / 3.0).abs() < 1e-2);
        }
        // As a curve in space, on a plane inclined by .3: its closest point to a place is across its tangent.
        let inclined = terms.fit(&heights(&points, 1.0), 1, &mut squares).unwrap();
        let (s, [up, aside]) = closest(&[graph, inclined], &[0.4], &[1.0, -0.5], [0.0]).unwrap();
        assert!((aside.value - 0.3 * s[0]).abs() < 1e-12);
        assert!((s[0] - 0.4 + (up.value - 1.0) * up.first[0] + (aside.value + 0.5) * aside.first[0]).abs() < 1e-12);
        assert!(terms.fit(&heights(&points[..4], 1.0), 0, &mut squares).is_none());
        let same = [([0.1], [0.0; 3]); 9];
        assert!(terms.fit(&heights(&same, 1.0), 0, &mut squares).is_none());
    }
}
