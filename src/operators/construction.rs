//! Construction of operators as sparse rows, in parallel.

use super::basis::Basis;
use super::charts::{Chart, Functional, Heights, Node};
use super::fits::{BLOCK, FitOutcome, Fits, RowSink, Support, SupportDiagnostics, Workspace};
use crate::linear_algebra::SparseRows;
use crate::linear_algebra::number::Lanes;
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

/// Operators for a list of functionals, with the diagnostics of their fits.
#[derive(Debug)]
pub struct Construction<const M: usize> {
    /// One operator per functional, in the order of the functionals.
    pub operators: Vec<SparseRows>,
    /// Heights of the surface over the plane of each point; empty where the chart does not need them.
    pub heights: Vec<Heights<M>>,
    /// Numbers of fallbacks and failures of the fits.
    pub fit_diagnostics: SupportDiagnostics,
}

/// Builds one operator per functional on the points of a chart.
///
/// The row of a point whose moment conditions cannot be met is a single NaN.
///
/// # Errors
/// [`Interrupted`] when the interrupt is raised.
///
/// ```
/// use meniscus::geometry::{Vector, fibonacci};
/// use meniscus::operators::charts::tangent::Metric;
/// use meniscus::operators::{Functional, Support, TangentChart, construct};
/// use meniscus::parallel::Interrupt;
///
/// // Δ_S z = −2 z on the unit sphere.
/// let points: Vec<Vector<3>> = fibonacci::sphere(1000);
/// let radius = 0.4;
/// let chart = TangentChart::new(&points, &points, Metric::FromNormals, radius);
/// let support = Support { degree: 4, radius };
/// let built = construct::<2>(&chart, support, &[Functional::LaplaceBeltrami], &Interrupt::default()).unwrap();
/// let z: Vec<f64> = points.iter().map(|x| x[2]).collect();
/// let mut laplacian = vec![0.0; 1000];
/// built.operators[0].apply(&z, &mut laplacian);
/// assert!(z.iter().zip(&laplacian).all(|(z, value)| (value + 2.0 * z).abs() < 1e-3));
/// ```
pub fn construct<const M: usize>(
    chart: &dyn Chart<M>,
    support: Support,
    functionals: &[Functional<M>],
    interrupt: &Interrupt,
) -> Result<Construction<M>, Interrupted> {
    let basis = Basis::<M>::new(support.degree);
    let fits = Fits { chart, basis: &basis, radius: support.radius, functionals };
    let count = chart.count();
    let blocks: Vec<(Rows, FitOutcome<M>)> = (0..count.div_ceil(BLOCK))
        .into_par_iter()
        .with_min_len(1)
        .map_init(Workspace::default, |workspace, block| {
            let mut rows = Rows { operators: vec![SparseRows::default(); functionals.len()], ..Rows::default() };
            let mut outcome = FitOutcome::default();
            let end = ((block + 1) * BLOCK).min(count);
            fits.run(block * BLOCK..end, interrupt, workspace, &mut rows, &mut outcome);
            (rows, outcome)
        })
        .collect();
    interrupt.check()?;
    let stacked = |k: usize| SparseRows::stacked(blocks.iter().map(|(rows, _)| &rows.operators[k]));
    let operators = (0..functionals.len()).map(stacked).collect();
    let mut fit_diagnostics = SupportDiagnostics::default();
    for (_, outcome) in &blocks {
        fit_diagnostics.add(&outcome.fit_diagnostics);
    }
    Ok(Construction {
        operators,
        heights: blocks.into_iter().flat_map(|(_, outcome)| outcome.heights).collect(),
        fit_diagnostics,
    })
}

/// Receives the weights of fits and appends them as rows.
#[derive(Default)]
struct Rows {
    operators: Vec<SparseRows>,
    columns: Vec<u32>,
    weights: Vec<f64>,
}

impl<const M: usize> RowSink<M> for Rows {
    /// Appends the row of point i: the weights of its neighbors, and a weight of the point itself with which the row
    /// sums to zero.
    fn take(&mut self, functional: usize, i: usize, nodes: &[Node<M>], weights: Option<(&[Lanes], usize)>) {
        let Some((weights, lane)) = weights else {
            // An unknown row must not look like a number.
            self.operators[functional].push_row(&[i as u32], &[f64::NAN]);
            return;
        };
        self.columns.clear();
        self.weights.clear();
        let mut sum = 0.0;
        for (node, weights) in nodes.iter().zip(weights) {
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
        self.operators[functional].push_row(&self.columns, &self.weights);
    }
}

#[cfg(test)]
mod tests {
    use super::{Construction, Support, construct};
    use crate::geometry::domain::Axis;
    use crate::geometry::random::CounterRandom;
    use crate::geometry::{Domain, Vector, fibonacci};
    use crate::neighbors::CellList;
    use crate::operators::charts::tangent::Metric;
    use crate::operators::{FlatChart, Functional, NormalCopies, TangentChart};
    use crate::parallel::Interrupt;
    use std::f64::consts::PI;

    fn spacing(count: usize) -> f64 {
        (4.0 * PI / count as f64).sqrt()
    }

    fn applied<const M: usize>(construction: &Construction<M>, k: usize, field: &[f64]) -> Vec<f64> {
        assert_eq!(construction.fit_diagnostics.failed, 0);
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
            for metric in [Metric::FromNormals, Metric::FromHeights] {
                let errors = [500, 2000, 8000].map(|count| error(count, degree, radius, metric, 0.0));
                // The spacing halves from each count to the next.
                let slope = 0.5 * (errors[0] / errors[2]).log2();
                assert!(slope > order, "degree {degree}: slope {slope}, {errors:?}");
            }
        }
    }

    /// Nine points in three rows: x³ is 3 x there about any of them, so that slopes are not known, but ∂xx + ∂yy is. A
    /// metric of fitted heights has no slopes to be made of; exact normals need none.
    #[test]
    fn heights_that_cannot_be_fitted_make_no_row() {
        let points: Vec<_> = (0..9).map(|k| Vector::<3>::new(f64::from(k % 3), f64::from(k / 3), 0.0)).collect();
        let normals = vec![Vector::<3>::z(); 9];
        let support = Support { degree: 3, radius: 2.9 };
        let fit_diagnostics = |metric: Metric| {
            let chart = TangentChart::new(&points, &normals, metric, support.radius);
            construct::<2>(&chart, support, &[Functional::LaplaceBeltrami], &Interrupt::default())
                .unwrap()
                .fit_diagnostics
        };
        let known = fit_diagnostics(Metric::FromNormals);
        assert_eq!((known.low_rank, known.failed, known.first_failed), (1, 8, Some(0)), "{known:?}");
        let fitted = fit_diagnostics(Metric::FromHeights);
        assert_eq!((fitted.low_rank, fitted.failed, fitted.first_failed), (0, 9, Some(0)), "{fitted:?}");
    }

    #[test]
    fn fitted_heights_make_up_for_normals_that_are_off() {
        let exact = error(4000, 5, 3.3, Metric::FromHeights, 0.0);
        let off = error(4000, 5, 3.3, Metric::FromHeights, 1e-2);
        assert!(off < 1.2 * exact, "{off:e} {exact:e}");
        assert!(error(4000, 5, 3.3, Metric::FromNormals, 1e-2) > 1e-3);
    }

    #[test]
    fn copies_along_normals_agree_with_the_intrinsic_form() {
        let count = 2000;
        let points = fibonacci::sphere(count);
        let harmonic: Vec<f64> = points.iter().map(|x| 3.0 * x[2] * x[2] - 1.0).collect();
        let exact: Vec<f64> = harmonic.iter().map(|f| -6.0 * f).collect();
        let delta = spacing(count);
        for (degree, bound) in [(3, 3e-2), (5, 2e-3)] {
            let chart = NormalCopies::new(&points, &points, 2, delta, 2.9 * delta);
            let support = Support { degree, radius: 2.9 * delta };
            let built = construct::<3>(&chart, support, &[Functional::LaplaceBeltrami], &Interrupt::default());
            let error = relative(&applied(&built.unwrap(), 0, &harmonic), &exact);
            assert!(error < bound, "degree {degree}: {error:e}");
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
        let mut cells = CellList::new(domain);
        cells.rebuild(points.iter().copied(), 3.0 * h);
        let chart = FlatChart::new(&points, &cells);
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
            assert!(found < [5e-3, 3e-2, 1e-1][which], "{which}: {found}");
        }
    }

    #[test]
    fn gradients_lie_in_the_surface() {
        let count = 4000;
        let points = fibonacci::sphere(count);
        let radius = 3.3 * spacing(count);
        let chart = TangentChart::new(&points, &points, Metric::FromNormals, radius);
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
