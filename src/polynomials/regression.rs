//! Local weighted least-squares fits of scattered values (PCP 3.1, eqs. 7 and 8) and their fallbacks.
//!
//! Where there are too few neighbors, or where they lie badly, the radius grows. If that does not help, the degree is
//! lowered.

use super::basis::{BasisKind, PolynomialBasis};
use super::local_polynomial::LocalPolynomial;
use super::moments::{LaneBatch, Moments};
use super::multi_index::term_count;
use super::neighborhood::{GROWTH, Neighborhood, gather};
use crate::geometry::Vector;
use crate::linear_algebra::least_squares::LeastSquares;
use crate::linear_algebra::number::LANES;
use crate::neighbors::{Neighbor, NeighborSearch};

/// The method by which a regression is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Solver {
    /// By the moments of scaled monomials, several fits at once. Fits with a pivot ratio below [`MIN_PIVOT`] are solved
    /// by orthogonal decomposition in the basis. The polynomial is the same in every basis.
    Moments,
    /// By orthogonal decomposition in the basis, one fit at a time.
    Orthogonal,
}

/// Parameters of all fits of a method.
///
/// ```
/// use meniscus::geometry::{Domain, Vector};
/// use meniscus::neighbors::CellList;
/// use meniscus::polynomials::{BasisKind, FitData, Neighborhood, PolynomialBasis};
/// use meniscus::polynomials::{Regression, RegressionScratch, Solver};
///
/// // The values x² on a lattice of spacing 1 are reproduced by a fit of degree 2.
/// let points: Vec<_> = (0..49).map(|k| Vector::<2>::new((k % 7) as f64, (k / 7) as f64)).collect();
/// let mut cells = CellList::new(Domain::unbounded());
/// cells.rebuild(points.iter().copied(), 2.0);
/// let basis = PolynomialBasis::new(BasisKind::Minter, 2);
/// let neighborhood = Neighborhood::Radius { cutoff: 2.1 };
/// let regression = Regression::<2>::new(basis, neighborhood, 2.0, 1.5, 1.0, Solver::Orthogonal);
/// let data = FitData { search: &cells, values: |j: usize, _| points[j][0].powi(2), quantities: 1, admit: |_, _| true };
/// let mut coefficients = vec![0.0; regression.terms()];
/// let fit = regression.fit(&data, 0, &points[24], &mut RegressionScratch::default(), &mut coefficients).unwrap();
/// let p = fit.polynomial(regression.degree(), &coefficients);
/// assert!((p.value(&Vector::<2>::new(0.5, 0.0)) - 3.5_f64.powi(2)).abs() < 1e-10);
/// ```
#[derive(Debug, Clone)]
pub struct Regression<const D: usize> {
    /// Polynomial basis of the full degree.
    pub basis: PolynomialBasis<D>,
    /// Rule by which particles take part in a fit.
    pub neighborhood: Neighborhood,
    /// Exponent k of the weight exp(−k r²/r_c²) of squared residuals; 0 gives all neighbors the same weight.
    pub weight: f64,
    /// Smallest number n_n/n_c of neighbors per coefficient, until which the radius grows.
    pub minimum_ratio: f64,
    /// Typical distance of particles, from which searches by count start.
    pub spacing: f64,
    /// Solver by moments; None where every fit is an orthogonal decomposition.
    moments: Option<Moments<D>>,
}

/// Geometry and quality of a fit. Its coefficients are stored by the caller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit<const D: usize> {
    /// Origin of the local coordinates.
    pub center: Vector<D>,
    /// Length of one local unit.
    pub scale: f64,
    /// Center of the support: the fit is valid within `radius` of this point.
    pub middle: Vector<D>,
    /// Cutoff radius r_c after growth, a length.
    pub radius: f64,
    /// Total degree, after it was lowered where necessary.
    pub degree: usize,
    /// Number n_n of neighbors.
    pub neighbors: usize,
    /// Number of times that the radius grew.
    pub enlargements: u32,
    /// Estimate of the condition number of the scaled matrix.
    pub condition: f64,
    /// Whether the solution by moments was too ill-conditioned, so that an orthogonal decomposition replaced it.
    pub decomposed: bool,
}

impl<const D: usize> Fit<D> {
    /// The fitted polynomial with its coefficients, which are laid out for `degree`.
    #[must_use]
    pub fn polynomial<'a>(&self, degree: usize, coefficients: &'a [f64]) -> LocalPolynomial<'a, D> {
        LocalPolynomial { degree, coefficients, center: self.center, scale: self.scale }
    }
}

/// Buffers that fits reuse.
#[derive(Debug, Clone, Default)]
pub struct RegressionScratch<const D: usize> {
    neighbors: Vec<Neighbor<D>>,
    lanes: [Vec<Neighbor<D>>; LANES],
    batch: LaneBatch<D>,
    system: LeastSquares,
    row: Vec<f64>,
    graded: Vec<f64>,
}

/// The particles and the values that are fitted.
#[derive(Debug, Clone, Copy)]
pub struct FitData<'a, S, V, A> {
    /// Search over the particles.
    pub search: &'a S,
    /// Value of a quantity at a particle: `values(particle, quantity)`.
    pub values: V,
    /// Number of quantities.
    pub quantities: usize,
    /// Whether a particle may take part in the fit of a lane: `admit(lane, particle)`.
    pub admit: A,
}

/// Number of enlargements of a rank-deficient fit before its degree is lowered.
const RANK_ENLARGEMENTS: u32 = 8;
/// Smallest pivot ratio of the moments that leaves enough digits.
pub const MIN_PIVOT: f64 = 1e-9;

impl<const D: usize> Regression<D> {
    /// Regressions with the given basis, neighborhood, weight, ratio, spacing and solver.
    #[must_use]
    pub fn new(
        basis: PolynomialBasis<D>,
        neighborhood: Neighborhood,
        weight: f64,
        minimum_ratio: f64,
        spacing: f64,
        solver: Solver,
    ) -> Self {
        // Moments of raw coordinates would lose all digits.
        let by_moments = solver == Solver::Moments && basis.kind() != BasisKind::MonomialUnscaled;
        let moments = by_moments.then(|| Moments::new(basis.degree()));
        Self { basis, neighborhood, weight, minimum_ratio, spacing, moments }
    }

    /// Total degree for which coefficients are laid out.
    #[must_use]
    pub fn degree(&self) -> usize {
        self.basis.degree()
    }

    /// Number of coefficients of the full degree.
    #[must_use]
    pub fn terms(&self) -> usize {
        term_count::<D>(self.basis.degree())
    }

    /// Number of neighbors until which the radius grows.
    fn needed(&self) -> usize {
        (self.minimum_ratio * self.terms() as f64).ceil() as usize
    }

    /// Fits every quantity around up to [`LANES`] centers.
    ///
    /// Coefficients are written center by center, quantity by quantity, in nested order. A fit is None where not even a
    /// plane can be fitted.
    ///
    /// 1. Collect the neighbors of each center.
    /// 2. With [`Solver::Moments`], solve all fits at once.
    /// 3. Solve the fits that have too few neighbors or a small pivot, or all fits with [`Solver::Orthogonal`], by
    ///    [`Self::fit`].
    pub fn fit_lanes<S: NeighborSearch<D>, V: Fn(usize, usize) -> f64, A: Fn(usize, usize) -> bool>(
        &self,
        data: &FitData<S, V, A>,
        centers: &[Vector<D>],
        scratch: &mut RegressionScratch<D>,
        coefficients: &mut [f64],
    ) -> [Option<Fit<D>>; LANES] {
        let size = data.quantities * self.terms();
        let mut fits = [None; LANES];
        if let Some(moments) = &self.moments {
            fits = self.fit_by_moments(moments, data, centers, scratch, coefficients);
        }
        for (lane, (x, coefficients)) in centers.iter().zip(coefficients.chunks_exact_mut(size)).enumerate() {
            if fits[lane].is_none() {
                let decomposed = self.moments.is_some();
                let fit = self.fit(data, lane, x, scratch, coefficients);
                fits[lane] = fit.map(|fit| Fit { decomposed, ..fit });
            }
        }
        fits
    }

    /// Steps 1 and 2 of [`Self::fit_lanes`]. A fit is None where the moments are not sufficient.
    fn fit_by_moments<S: NeighborSearch<D>, V: Fn(usize, usize) -> f64, A: Fn(usize, usize) -> bool>(
        &self,
        moments: &Moments<D>,
        data: &FitData<S, V, A>,
        centers: &[Vector<D>],
        scratch: &mut RegressionScratch<D>,
        coefficients: &mut [f64],
    ) -> [Option<Fit<D>>; LANES] {
        let FitData { search, values, quantities, admit } = data;
        let (terms, quantities) = (self.terms(), *quantities);
        let mut extents = [None; LANES];
        let mut rows = 0;
        for (lane, x) in centers.iter().enumerate() {
            let neighbors = &mut scratch.lanes[lane];
            let admit = |j: usize| admit(lane, j);
            extents[lane] = Some(self.neighborhood.collect(*search, x, self.needed(), self.spacing, &admit, neighbors));
            rows = rows.max(neighbors.len());
        }
        let batch = &mut scratch.batch;
        batch.reset(rows, quantities);
        for (lane, extent) in extents.iter().enumerate() {
            let Some(extent) = extent else { continue };
            let inverse = 1.0 / extent.radius;
            for (row, neighbor) in scratch.lanes[lane].iter().enumerate() {
                batch.set_row(lane, row, &std::array::from_fn(|d| neighbor.dx[d] * inverse), 1.0);
                for quantity in 0..quantities {
                    batch.set_value(lane, row, quantity, values(neighbor.index, quantity));
                }
            }
        }
        batch.apply_weights(self.weight);
        let (least, solution) = moments.solve(batch, quantities);
        let least = least.to_array();
        let mut fits = [None; LANES];
        for (lane, (x, extent)) in centers.iter().zip(extents).enumerate() {
            let Some(extent) = extent else { continue };
            let neighbors = scratch.lanes[lane].len();
            // The comparison also refuses a NaN.
            let is_sound = neighbors >= terms && least[lane] >= MIN_PIVOT;
            let own = &mut coefficients[lane * quantities * terms..(lane + 1) * quantities * terms];
            for (c, lanes) in own.iter_mut().zip(solution) {
                *c = lanes.as_array()[lane];
            }
            if is_sound && own.iter().all(|c| c.is_finite()) {
                fits[lane] = Some(Fit {
                    center: *x,
                    scale: extent.radius,
                    middle: *x,
                    radius: extent.radius,
                    degree: self.basis.degree(),
                    neighbors,
                    enlargements: extent.enlargements,
                    condition: 1.0 / least[lane].sqrt(),
                    decomposed: false,
                });
            }
        }
        fits
    }

    /// Fits the values around `x`, the center of a lane, by orthogonal decomposition.
    ///
    /// Coefficients are written in nested order; those beyond a lowered degree are 0.
    ///
    /// 1. Collect neighbors. Enlarge the radius until n_n ≥ minimum_ratio · n_c.
    /// 2. Solve. If the matrix is rank-deficient, enlarge the radius further, then lower the degree one by one.
    ///
    /// Returns None when not even a plane can be fitted.
    pub fn fit<S: NeighborSearch<D>, V: Fn(usize, usize) -> f64, A: Fn(usize, usize) -> bool>(
        &self,
        data: &FitData<S, V, A>,
        lane: usize,
        x: &Vector<D>,
        scratch: &mut RegressionScratch<D>,
        coefficients: &mut [f64],
    ) -> Option<Fit<D>> {
        coefficients.fill(0.0);
        let (search, admit) = (data.search, |j: usize| (data.admit)(lane, j));
        let mut degree = self.basis.degree();
        let extent = self.neighborhood.collect(search, x, self.needed(), self.spacing, &admit, &mut scratch.neighbors);
        let (mut radius, mut enlargements) = (extent.radius, extent.enlargements);
        let mut rank_enlargements = 0;
        loop {
            let enough = scratch.neighbors.len() >= term_count::<D>(degree);
            if enough && let Some(condition) = self.solve(data, x, radius, degree, scratch, coefficients) {
                let unscaled = self.basis.kind() == BasisKind::MonomialUnscaled;
                return Some(Fit {
                    center: if unscaled { Vector::<D>::zeros() } else { *x },
                    scale: if unscaled { 1.0 } else { radius },
                    middle: *x,
                    radius,
                    degree,
                    neighbors: scratch.neighbors.len(),
                    enlargements,
                    condition,
                    decomposed: false,
                });
            }
            if enough && rank_enlargements < RANK_ENLARGEMENTS {
                rank_enlargements += 1;
                enlargements += 1;
                radius *= GROWTH;
                gather(search, x, radius, &admit, &mut scratch.neighbors);
            } else if degree > 1 {
                degree -= 1;
                rank_enlargements = 0;
            } else {
                return None;
            }
        }
    }

    /// Solves the least-squares problem of the collected neighbors. Returns its condition number, or None when the
    /// matrix is rank-deficient.
    fn solve<S, V: Fn(usize, usize) -> f64, A>(
        &self,
        data: &FitData<S, V, A>,
        x: &Vector<D>,
        radius: f64,
        degree: usize,
        scratch: &mut RegressionScratch<D>,
        coefficients: &mut [f64],
    ) -> Option<f64> {
        let terms = term_count::<D>(degree);
        let unscaled = self.basis.kind() == BasisKind::MonomialUnscaled;
        let inverse = 1.0 / radius;
        let mut condition = 0.0;
        for (quantity, own) in coefficients.chunks_exact_mut(self.terms()).enumerate() {
            scratch.system.reset(scratch.neighbors.len(), terms);
            scratch.row.resize(terms, 0.0);
            for (row, neighbor) in scratch.neighbors.iter().enumerate() {
                let local = if unscaled { x + neighbor.dx } else { neighbor.dx * inverse };
                self.basis.row(&local, degree, &mut scratch.row);
                let mut value = (data.values)(neighbor.index, quantity);
                if self.weight > 0.0 {
                    // A row is multiplied by the square root of its weight.
                    let w = (-0.5 * self.weight * neighbor.r2 * inverse * inverse).exp();
                    scratch.row.iter_mut().for_each(|a| *a *= w);
                    value *= w;
                }
                scratch.system.set_row(row, &scratch.row, value);
            }
            let (found, solution) = scratch.system.solve();
            if found.rank < terms {
                return None;
            }
            scratch.graded.clear();
            scratch.graded.extend_from_slice(solution);
            self.basis.expand(&mut scratch.graded, own);
            condition = found.condition;
        }
        coefficients.iter().all(|c| c.is_finite()).then_some(condition)
    }
}

#[cfg(test)]
mod tests {
    use super::{
        BasisKind, Fit, FitData, LANES, Neighborhood, PolynomialBasis, Regression, RegressionScratch, Solver, Vector,
    };
    use crate::geometry::Domain;
    use crate::geometry::lattice::Lattice;
    use crate::neighbors::CellList;
    use crate::parallel::Interrupt;

    fn cloud(jitter: f64) -> Vec<Vector<2>> {
        let lattice = Lattice { spacing: 0.1, offset: 0.0, jitter, seed: 2 };
        lattice.points_near(&Vector::<2>::repeat(-1.0), &Vector::<2>::repeat(1.0), 1.0, |_| 0.0, &Interrupt::default())
    }

    fn regression(kind: BasisKind, degree: usize, neighborhood: Neighborhood) -> Regression<2> {
        Regression::new(PolynomialBasis::new(kind, degree), neighborhood, 2.0, 1.5, 0.1, Solver::Orthogonal)
    }

    fn fit(
        regression: &Regression<2>,
        cells: &CellList<2>,
        x: &Vector<2>,
        values: &[f64],
        coefficients: &mut [f64],
    ) -> Option<Fit<2>> {
        let data = FitData { search: cells, values: |j, _| values[j], quantities: 1, admit: |_, _| true };
        regression.fit(&data, 0, x, &mut RegressionScratch::default(), coefficients)
    }

    /// Compares moments with orthogonal decompositions for two quantities at once.
    fn compare_solvers<const D: usize>(degree: usize, tolerance: f64) {
        let lattice = Lattice { spacing: 0.1, offset: 0.0, jitter: 0.49, seed: 4 };
        let corner = Vector::<D>::repeat(0.85);
        let points = lattice.points_near(&-corner, &corner, 1.0, |_| 0.0, &Interrupt::default());
        let values: [Vec<f64>; 2] = [
            points.iter().map(|x| (3.0 * x[0]).sin() * (x[1] - 0.2).cosh() + x[D - 1]).collect(),
            points.iter().map(|x| (x.norm_squared() + 0.1).sqrt() - 0.4).collect(),
        ];
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), 0.15);
        let make = |solver| {
            let basis = PolynomialBasis::new(BasisKind::Minter, degree);
            Regression::<D>::new(basis, Neighborhood::Radius { cutoff: 0.25 }, 2.0, 1.5, 0.1, solver)
        };
        let (fast, oracle) = (make(Solver::Moments), make(Solver::Orthogonal));
        let terms = fast.terms();
        let mut scratch = RegressionScratch::default();
        let middle: Vec<Vector<D>> = points.iter().filter(|x| x.norm() < 0.3).take(15).copied().collect();
        let data = FitData { search: &cells, values: |j, q: usize| values[q][j], quantities: 2, admit: |_, _| true };
        for centers in middle.chunks(LANES) {
            let mut ours = vec![0.0; LANES * 2 * terms];
            let fits = fast.fit_lanes(&data, centers, &mut scratch, &mut ours);
            for (lane, x) in centers.iter().enumerate() {
                let mut exact = vec![0.0; 2 * terms];
                let reference = oracle.fit(&data, lane, x, &mut scratch, &mut exact).unwrap();
                let fit = fits[lane].unwrap();
                assert_eq!((fit.neighbors, fit.radius), (reference.neighbors, reference.radius));
                assert!(!fit.decomposed, "degree {degree}: condition {}", fit.condition);
                let size = exact.iter().map(|c| c.abs()).fold(0.0, f64::max);
                for (a, b) in ours[lane * 2 * terms..].iter().zip(&exact) {
                    assert!((a - b).abs() < tolerance * size, "degree {degree} in {D} dimensions: {a} for {b}");
                }
            }
        }
    }

    #[test]
    fn moments_agree_with_orthogonal_decompositions() {
        for (degree, tolerance) in [(1, 1e-13), (2, 1e-13), (3, 1e-12), (4, 1e-11), (5, 1e-11), (6, 1e-10), (8, 1e-8)] {
            compare_solvers::<2>(degree, tolerance);
        }
        for (degree, tolerance) in [(1, 1e-13), (2, 1e-13), (3, 1e-12), (4, 1e-11), (5, 1e-11)] {
            compare_solvers::<3>(degree, tolerance);
        }
    }

    #[test]
    fn every_basis_reproduces_polynomials_of_its_degree() {
        let points = cloud(0.45);
        let values: Vec<f64> =
            points.iter().map(|x| 1.0 + x[0] - 2.0 * x[1] * x[0] + x[1].powi(4) - x[0].powi(3)).collect();
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), 0.1);
        for kind in [BasisKind::Minter, BasisKind::Monomial, BasisKind::MonomialUnscaled] {
            for neighborhood in [Neighborhood::Radius { cutoff: 0.1 }, Neighborhood::Nearest { count: 25 }] {
                let regression = regression(kind, 4, neighborhood);
                let mut coefficients = vec![0.0; 15];
                let at = Vector::<2>::new(0.21, -0.33);
                let fit = fit(&regression, &cells, &at, &values, &mut coefficients).unwrap();
                assert_eq!(fit.degree, 4);
                assert!(fit.neighbors >= 23, "{} neighbors", fit.neighbors);
                let x = Vector::<2>::new(0.25, -0.3);
                let exact = 1.0 + x[0] - 2.0 * x[1] * x[0] + x[1].powi(4) - x[0].powi(3);
                let value = fit.polynomial(regression.degree(), &coefficients).value(&(x - fit.center));
                assert!((value - exact).abs() < 1e-11, "{kind:?}: {value} for {exact}");
            }
        }
    }

    #[test]
    fn particles_on_a_line_lower_the_degree_to_none() {
        let points: Vec<Vector<2>> = (0..40).map(|k| Vector::<2>::new(0.1 * f64::from(k), 0.0)).collect();
        let values = vec![1.0; 40];
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), 0.1);
        let regression = regression(BasisKind::Minter, 3, Neighborhood::Radius { cutoff: 0.3 });
        let mut coefficients = vec![0.0; 10];
        assert!(fit(&regression, &cells, &points[20], &values, &mut coefficients).is_none());
    }

    #[test]
    fn few_particles_give_a_lower_degree_and_are_counted() {
        let points: Vec<Vector<2>> = cloud(0.3).into_iter().take(5).chain([Vector::<2>::new(-0.95, -0.8)]).collect();
        let values: Vec<f64> = points.iter().map(|x| x[0] + 2.0 * x[1]).collect();
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), 0.1);
        let regression = regression(BasisKind::Monomial, 4, Neighborhood::Radius { cutoff: 0.2 });
        let mut coefficients = vec![0.0; 15];
        let fit = fit(&regression, &cells, &points[2], &values, &mut coefficients).unwrap();
        assert!(fit.degree <= 2 && fit.enlargements > 0);
        let x = Vector::<2>::new(-0.8, -0.9);
        let value = fit.polynomial(regression.degree(), &coefficients).value(&(x - fit.center));
        assert!((value + 2.6).abs() < 1e-10);
    }
}
