//! Rows of operators from the fits of a chart, four points side by side, in parallel.
//!
//! Supports that do not hold enough grow; where that does not do, or a chart's must not, the moment conditions are solved by a
//! rank-revealing decomposition, and the row stands if they hold. Everything is counted.

use super::basis::Basis;
use super::charts::{Chart, Functional, Heights};
use super::moment_fit::MomentFit;
use crate::linear_algebra::SparseRows;
use crate::linear_algebra::number::{LANES, Lanes};
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};
use std::ops::Range;

/// Degree of the polynomials and the support of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Total degree: at most 7.
    pub degree: usize,
    /// Radius of the support, r_c.
    pub radius: f64,
}

/// What a construction came to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Soundness {
    /// How often a support was enlarged.
    pub enlarged: u64,
    /// Points whose moment conditions were solved by the rank-revealing decomposition.
    pub low_rank: u64,
    /// Points whose moment conditions cannot be met: their rows give no number.
    pub failed: u64,
    /// The least share of a pivot in its diagonal, of all points that were solved directly.
    pub least_pivot: f64,
}

/// Operators, one for each functional asked for, and what became of the points.
#[derive(Debug)]
pub struct Construction<const M: usize> {
    /// The operators, in the order of the functionals.
    pub operators: Vec<SparseRows>,
    /// Heights of the surface over the plane of each point, where the chart needs them.
    pub heights: Vec<Heights<M>>,
    /// Counts.
    pub soundness: Soundness,
}

/// Neighbours for a function at least: fewer make the fit an interpolation of noise.
const NEIGHBORS_A_FUNCTION: f64 = 1.4;
/// How a support grows that is not enough, and how far.
const GROWTH: f64 = 1.2;
/// The largest support by r_c.
pub const MOST_GROWTH: f64 = 2.5;
/// Below this share of a pivot in its diagonal the moment conditions do not hold to the digits that are wanted.
const LEAST_PIVOT: f64 = 1e-9;
/// Moment conditions that a rank-revealing solution may leave open, by the largest.
const OPEN_MOMENTS: f64 = 1e-6;
/// Points of a parallel task; a multiple of the lanes.
const BLOCK: usize = 64;

/// Operators for the functionals on the points of a chart.
///
/// # Errors
/// [`Interrupted`].
pub fn construct<const M: usize>(
    chart: &dyn Chart<M>,
    support: Support,
    functionals: &[Functional<M>],
    interrupt: &Interrupt,
) -> Result<Construction<M>, Interrupted> {
    let basis = Basis::<M>::new(support.degree);
    let task = Task { chart, basis: &basis, radius: support.radius, functionals };
    let count = chart.count();
    let blocks: Vec<Part<M>> = (0..count.div_ceil(BLOCK))
        .into_par_iter()
        .with_min_len(1)
        .map_init(Work::default, |work, block| {
            let mut part = Part::new(functionals.len());
            let end = ((block + 1) * BLOCK).min(count);
            for first in (block * BLOCK..end).step_by(LANES) {
                if interrupt.is_raised() {
                    break;
                }
                task.rows_of(first..(first + LANES).min(end), work, &mut part);
            }
            part
        })
        .collect();
    interrupt.check()?;
    let stacked = |k: usize| SparseRows::stacked(blocks.iter().map(|part| &part.operators[k]));
    let mut soundness = Soundness { least_pivot: 1.0, ..Soundness::default() };
    for Part { soundness: found, .. } in &blocks {
        soundness.enlarged += found.enlarged;
        soundness.low_rank += found.low_rank;
        soundness.failed += found.failed;
        soundness.least_pivot = soundness.least_pivot.min(found.least_pivot);
    }
    let operators = (0..functionals.len()).map(stacked).collect();
    Ok(Construction { operators, heights: blocks.into_iter().flat_map(|part| part.heights).collect(), soundness })
}

/// What a task of points makes.
struct Part<const M: usize> {
    operators: Vec<SparseRows>,
    heights: Vec<Heights<M>>,
    soundness: Soundness,
}

impl<const M: usize> Part<M> {
    fn new(functionals: usize) -> Self {
        let soundness = Soundness { least_pivot: 1.0, ..Soundness::default() };
        Self { operators: vec![SparseRows::default(); functionals], heights: Vec::new(), soundness }
    }
}

/// Storage of a thread.
#[derive(Default)]
struct Work<const M: usize> {
    fit: MomentFit<M>,
    terms: Vec<([u8; M], f64)>,
    functional: Vec<f64>,
    /// Values of the functional in hand on the functions, lane by lane.
    values: Vec<[f64; LANES]>,
    columns: Vec<u32>,
    weights: Vec<f64>,
}

struct Task<'a, const M: usize> {
    chart: &'a dyn Chart<M>,
    basis: &'a Basis<M>,
    radius: f64,
    functionals: &'a [Functional<M>],
}

impl<const M: usize> Task<'_, M> {
    /// The rows of up to four points, one a lane.
    fn rows_of(&self, points: Range<usize>, work: &mut Work<M>, part: &mut Part<M>) {
        let number = self.basis.size();
        let wanted = (NEIGHBORS_A_FUNCTION * number as f64).ceil() as usize;
        let last = points.end - 1;
        let nominal: [f64; LANES] =
            std::array::from_fn(|lane| self.radius * self.chart.scale((points.start + lane).min(last)));
        let mut reach = nominal;
        let can_grow = |lane: usize, reach: f64| self.chart.may_grow() && reach * GROWTH <= MOST_GROWTH * nominal[lane];
        for (lane, i) in points.clone().enumerate() {
            loop {
                self.chart.gather(i, reach[lane], &mut work.fit.near[lane]);
                if work.fit.near[lane].len() >= wanted || !can_grow(lane, reach[lane]) {
                    break;
                }
                reach[lane] *= GROWTH;
                part.soundness.enlarged += 1;
            }
        }
        for lane in points.len()..LANES {
            // Spare lanes repeat the first.
            work.fit.near[lane] = work.fit.near[0].clone();
            reach[lane] = reach[0];
        }
        loop {
            let pivots = work.fit.factorise(self.basis);
            let is_sound =
                |lane: usize, work: &Work<M>| pivots[lane] > LEAST_PIVOT && work.fit.near[lane].len() >= number;
            let mut is_again = false;
            for (lane, i) in points.clone().enumerate() {
                if !is_sound(lane, work) && can_grow(lane, reach[lane]) {
                    reach[lane] *= GROWTH;
                    part.soundness.enlarged += 1;
                    self.chart.gather(i, reach[lane], &mut work.fit.near[lane]);
                    is_again = true;
                }
            }
            if !is_again {
                let sound: [bool; LANES] = std::array::from_fn(|lane| is_sound(lane, work));
                for lane in 0..points.len() {
                    if sound[lane] {
                        part.soundness.least_pivot = part.soundness.least_pivot.min(pivots[lane]);
                    }
                }
                self.finish(&points, reach, sound, work, part);
                return;
            }
        }
    }

    /// Solutions for every functional, with the supports and the factorization as they stand.
    fn finish(
        &self,
        points: &Range<usize>,
        reach: [f64; LANES],
        sound: [bool; LANES],
        work: &mut Work<M>,
        part: &mut Part<M>,
    ) {
        let heights = self.chart.needs_heights().then(|| self.heights(reach, work));
        let mut holds = sound;
        for (k, functional) in self.functionals.iter().enumerate() {
            let number = self.basis.size();
            work.values.clear();
            work.values.resize(number, [0.0; LANES]);
            for lane in 0..LANES {
                let i = points.start + lane.min(points.len().saturating_sub(1));
                work.terms.clear();
                let of_lane = heights.as_ref().map(|heights| &heights[lane]);
                self.chart.terms(*functional, i, of_lane, &mut work.terms);
                for (alpha, coefficient) in &work.terms {
                    // Functions are of coordinates by the reach.
                    let order: u8 = alpha.iter().sum();
                    let scale = coefficient * reach[lane].powi(-i32::from(order));
                    if let Some(values) = self.basis.derivative(alpha) {
                        for (sum, value) in work.values.iter_mut().zip(values) {
                            sum[lane] += scale * value;
                        }
                    }
                }
            }
            work.fit.solution.clear();
            work.fit.solution.extend(work.values.iter().map(|values| Lanes::new(*values)));
            work.fit.solve();
            for (lane, i) in points.clone().enumerate() {
                if !sound[lane] {
                    work.functional.clear();
                    work.functional.extend(work.values.iter().map(|values| values[lane]));
                    let open = work.fit.solve_low_rank(lane, &work.functional);
                    holds[lane] = (k == 0 || holds[lane]) && open <= OPEN_MOMENTS;
                }
                if sound[lane] || holds[lane] {
                    work.push_row(lane, i, &mut part.operators[k]);
                } else {
                    // What is not known must not look like a number.
                    part.operators[k].push_row(&[i as u32], &[f64::NAN]);
                }
            }
        }
        for lane in (0..points.len()).filter(|lane| !sound[*lane]) {
            if holds[lane] {
                part.soundness.low_rank += 1;
            } else {
                part.soundness.failed += 1;
            }
        }
        if let Some(heights) = heights {
            part.heights.extend_from_slice(&heights[..points.len()]);
        }
    }

    /// Slopes and second derivatives of the surface over the plane of each lane.
    fn heights(&self, reach: [f64; LANES], work: &mut Work<M>) -> [Heights<M>; LANES] {
        work.fit.solve_heights(self.basis.size());
        let derivative = |alpha: [u8; M], lane: usize| -> f64 {
            let values = self.basis.derivative(&alpha).unwrap_or(&[]);
            values.iter().zip(&work.fit.solution).map(|(value, c)| value * c.as_array()[lane]).sum()
        };
        std::array::from_fn(|lane| Heights {
            first: std::array::from_fn(|a| derivative(std::array::from_fn(|d| u8::from(d == a)), lane)),
            second: std::array::from_fn(|a| {
                std::array::from_fn(|b| {
                    let alpha = std::array::from_fn(|d| u8::from(d == a) + u8::from(d == b));
                    derivative(alpha, lane) / reach[lane]
                })
            }),
        })
    }
}

impl<const M: usize> Work<M> {
    /// The row of a lane: its neighbours, and for the point itself what makes the sum zero.
    fn push_row(&mut self, lane: usize, i: usize, rows: &mut SparseRows) {
        self.columns.clear();
        self.weights.clear();
        let mut sum = 0.0;
        for (node, weights) in self.fit.near[lane].iter().zip(&self.fit.weights) {
            if node.index as usize == i {
                continue;
            }
            let weight = weights.as_array()[lane];
            sum += weight;
            match (self.columns.last(), self.weights.last_mut()) {
                (Some(last), Some(total)) if *last == node.index => *total += weight,
                _ => {
                    self.columns.push(node.index);
                    self.weights.push(weight);
                }
            }
        }
        self.columns.push(i as u32);
        self.weights.push(-sum);
        rows.push_row(&self.columns, &self.weights);
    }
}

#[cfg(test)]
mod tests {
    use super::{Construction, Support, construct};
    use crate::geometry::domain::Axis;
    use crate::geometry::random::CounterRandom;
    use crate::geometry::{Domain, Vector, fibonacci};
    use crate::operators::charts::tangent::Metric;
    use crate::operators::{FlatChart, Functional, NormalCopies, TangentChart};
    use crate::parallel::Interrupt;
    use std::f64::consts::PI;

    fn spacing(count: usize) -> f64 {
        (4.0 * PI / count as f64).sqrt()
    }

    fn applied<const M: usize>(construction: &Construction<M>, k: usize, field: &[f64]) -> Vec<f64> {
        assert_eq!(construction.soundness.failed, 0);
        let mut out = vec![0.0; construction.operators[k].rows()];
        construction.operators[k].apply(field, &mut out);
        out
    }

    fn relative(found: &[f64], exact: &[f64]) -> f64 {
        let top: f64 = found.iter().zip(exact).map(|(a, b)| (a - b).powi(2)).sum();
        (top / exact.iter().map(|b| b * b).sum::<f64>()).sqrt()
    }

    /// Relative L2 error of Δ_S of the plane wave sin(k·x) on the unit sphere, with normals off by `sigma`.
    fn error(count: usize, degree: usize, radius: f64, metric: Metric, sigma: f64) -> f64 {
        let points = fibonacci::sphere(count);
        let random = CounterRandom::new(3);
        let off = |i: usize| Vector::<3>::from_fn(|d, _| sigma * random.symmetric(&[i as i64, d as i64]));
        let normals: Vec<_> = points.iter().enumerate().map(|(i, x)| (x + off(i)).normalize()).collect();
        let chart = TangentChart::new(&points, &normals, metric, radius * spacing(count));
        let support = Support { degree, radius: radius * spacing(count) };
        let built = construct::<2>(&chart, support, &[Functional::LaplaceBeltrami], &Interrupt::default()).unwrap();
        let wave = Vector::<3>::new(2.0, -1.0, 3.0);
        let field: Vec<f64> = points.iter().map(|x| wave.dot(x).sin()).collect();
        let exact = |x: &Vector<3>| {
            let along = wave.dot(x);
            -(wave.norm_squared() - along * along) * along.sin() - 2.0 * along * along.cos()
        };
        relative(&applied(&built, 0, &field), &points.iter().map(exact).collect::<Vec<_>>())
    }

    #[test]
    fn orders_are_one_below_the_degree() {
        for (degree, radius, order) in [(3, 2.4, 1.95), (5, 3.3, 3.9), (7, 4.2, 5.8)] {
            for metric in [Metric::OfNormals, Metric::OfHeights] {
                let errors = [500, 2000, 8000].map(|count| error(count, degree, radius, metric, 0.0));
                // Spacing halves from one to the next.
                let slope = 0.5 * (errors[0] / errors[2]).log2();
                assert!(slope > order, "degree {degree}: slope {slope}, {errors:?}");
            }
        }
    }

    #[test]
    fn fitted_heights_make_up_for_normals_that_are_off() {
        let exact = error(4000, 5, 3.3, Metric::OfHeights, 0.0);
        let off = error(4000, 5, 3.3, Metric::OfHeights, 1e-2);
        assert!(off < 1.2 * exact, "{off:e} {exact:e}");
        assert!(error(4000, 5, 3.3, Metric::OfNormals, 1e-2) > 1e-3);
    }

    #[test]
    fn copies_along_normals_agree_with_the_intrinsic_form() {
        let count = 2000;
        let points = fibonacci::sphere(count);
        let harmonic: Vec<f64> = points.iter().map(|x| 3.0 * x[2] * x[2] - 1.0).collect();
        let exact: Vec<f64> = harmonic.iter().map(|f| -6.0 * f).collect();
        let delta = spacing(count);
        for (degree, most) in [(3, 3e-2), (5, 2e-3)] {
            let chart = NormalCopies::new(&points, &points, 2, delta, 2.9 * delta);
            let support = Support { degree, radius: 2.9 * delta };
            let built = construct::<3>(&chart, support, &[Functional::LaplaceBeltrami], &Interrupt::default());
            let error = relative(&applied(&built.unwrap(), 0, &harmonic), &exact);
            assert!(error < most, "degree {degree}: {error:e}");
        }
    }

    #[test]
    fn flat_derivatives_of_polynomials_are_exact_across_the_edge_too() {
        let random = CounterRandom::new(5);
        let n = 20_i64;
        let h = 1.0 / n as f64;
        let cell = |i: i64| Vector::<2>::new((i % n) as f64, (i / n) as f64);
        let points: Vec<_> = (0..n * n)
            .map(|i| (cell(i) + Vector::<2>::from_fn(|d, _| 0.5 + 0.2 * random.symmetric(&[i, d as i64]))) * h)
            .collect();
        let domain = Domain::new([Axis::Periodic { start: 0.0, length: 1.0 }; 2]);
        let chart = FlatChart::new(&points, domain, 3.0 * h);
        let functionals = [[1, 0], [0, 2], [1, 2]].map(Functional::Partial);
        let support = Support { degree: 4, radius: 3.0 * h };
        let built = construct::<2>(&chart, support, &functionals, &Interrupt::default()).unwrap();
        // A wave that the edge does not cut.
        let k = 2.0 * PI;
        let field: Vec<f64> = points.iter().map(|x| (k * x[0]).sin() * (k * x[1]).cos()).collect();
        let exact: [fn(&Vector<2>, f64) -> f64; 3] = [
            |x, k| k * (k * x[0]).cos() * (k * x[1]).cos(),
            |x, k| -k * k * (k * x[0]).sin() * (k * x[1]).cos(),
            |x, k| -k * k * k * (k * x[0]).cos() * (k * x[1]).cos(),
        ];
        for (which, exact) in exact.iter().enumerate() {
            let expected: Vec<f64> = points.iter().map(|x| exact(x, k)).collect();
            let found = relative(&applied(&built, which, &field), &expected);
            // The higher the derivative, the fewer orders are left of degree 4.
            assert!(found < [2e-3, 2e-2, 6e-2][which], "{which}: {found}");
        }
    }

    #[test]
    fn gradients_lie_in_the_surface() {
        let count = 4000;
        let points = fibonacci::sphere(count);
        let radius = 3.3 * spacing(count);
        let chart = TangentChart::new(&points, &points, Metric::OfNormals, radius);
        let functionals = [0, 1, 2].map(Functional::Gradient);
        let built = construct::<2>(&chart, Support { degree: 5, radius }, &functionals, &Interrupt::default()).unwrap();
        // ∇_S of x is e_x − n n_x.
        let field: Vec<f64> = points.iter().map(|x| x[0]).collect();
        for axis in 0..3 {
            let exact: Vec<f64> = points.iter().map(|x| f64::from(u8::from(axis == 0)) - x[axis] * x[0]).collect();
            assert!(relative(&applied(&built, axis, &field), &exact) < 1e-6);
        }
    }
}
