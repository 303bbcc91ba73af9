//! Local least-squares fits of scattered values (PCP paper, section 3.1, eqs. 7 and 8), with the fallbacks that keep
//! a fit from being worse than none: the radius grows with the neighbour count, then the degree falls.

use super::basis::{BasisKind, PolynomialBasis};
use super::local_polynomial::LocalPolynomial;
use super::multi_index::term_count;
use crate::geometry::Vector;
use crate::linear_algebra::least_squares::LeastSquares;
use crate::neighbors::NeighborSearch;

/// Which particles take part in a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Neighborhood {
    /// All within a radius, which grows until there are enough.
    Radius {
        /// r_c in absolute length.
        cutoff: f64,
    },
    /// The nearest ones, the particle itself included.
    Nearest {
        /// How many.
        count: usize,
    },
}

/// The parameters of all fits of one method.
#[derive(Debug, Clone)]
pub struct Regression<const D: usize> {
    /// Basis of the full degree.
    pub basis: PolynomialBasis<D>,
    /// Which particles take part.
    pub neighborhood: Neighborhood,
    /// k of the weight exp(−k r²/r_c²) on squared residuals; 0 weighs all the same.
    pub weight: f64,
    /// Least n_n/n_c: the radius grows until there are so many neighbours per coefficient.
    pub minimum_ratio: f64,
    /// A length of the order of the particle spacing, where searches by count begin.
    pub spacing: f64,
}

/// Geometry and quality of one fit; the coefficients stand beside it in the caller's storage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit<const D: usize> {
    /// Origin of the local coordinates.
    pub centre: Vector<D>,
    /// Length of one local unit.
    pub scale: f64,
    /// Where the fit may be used: within `radius` of `middle`.
    pub middle: Vector<D>,
    /// r_c after growth.
    pub radius: f64,
    /// Degree after fallback.
    pub degree: usize,
    /// n_n.
    pub neighbors: usize,
    /// How often the radius grew.
    pub enlargements: u32,
    /// Condition estimate of the scaled matrix.
    pub condition: f64,
}

impl<const D: usize> Fit<D> {
    /// The fitted polynomial over coefficients stored elsewhere.
    #[must_use]
    pub fn polynomial<'a>(&self, basis: &'a PolynomialBasis<D>, coefficients: &'a [f64]) -> LocalPolynomial<'a, D> {
        LocalPolynomial { basis, degree: self.degree, coefficients, centre: self.centre, scale: self.scale }
    }
}

/// Storage that fits reuse.
#[derive(Debug, Clone, Default)]
pub struct RegressionScratch<const D: usize> {
    neighbors: Vec<(f64, usize, Vector<D>)>,
    system: LeastSquares,
    row: Vec<f64>,
}

/// Factor of one enlargement.
const GROWTH: f64 = 1.06;
/// Most enlargements: 1.06⁴⁰ ≈ 10.
const MOST_ENLARGEMENTS: u32 = 40;
/// Enlargements tried for a matrix of low rank before the degree falls.
const RANK_ENLARGEMENTS: u32 = 8;

impl<const D: usize> Regression<D> {
    /// Number of coefficients of the full degree.
    #[must_use]
    pub fn terms(&self) -> usize {
        term_count::<D>(self.basis.degree())
    }

    /// Fits the values around `x` and writes the coefficients in Newton form (terms beyond a lowered degree are 0).
    ///
    /// 1. Collect neighbours; grow the radius until n_n ≥ minimum_ratio · n_c.
    /// 2. Solve; on a low rank grow further, then lower the degree one by one.
    ///
    /// None when not even a plane can be fitted.
    pub fn fit(
        &self,
        search: &impl NeighborSearch<D>,
        x: &Vector<D>,
        values: &[f64],
        scratch: &mut RegressionScratch<D>,
        coefficients: &mut [f64],
    ) -> Option<Fit<D>> {
        coefficients.fill(0.0);
        let mut degree = self.basis.degree();
        let (mut radius, mut enlargements) = self.collect(search, x, degree, scratch);
        let mut rank_enlargements = 0;
        loop {
            let terms = term_count::<D>(degree);
            let enough = scratch.neighbors.len() >= terms;
            if enough
                && let Some(condition) = self.solve(x, values, radius, degree, scratch, &mut coefficients[..terms])
            {
                let unscaled = self.basis.kind() == BasisKind::MonomialUnscaled;
                return Some(Fit {
                    centre: if unscaled { Vector::<D>::zeros() } else { *x },
                    scale: if unscaled { 1.0 } else { radius },
                    middle: *x,
                    radius,
                    degree,
                    neighbors: scratch.neighbors.len(),
                    enlargements,
                    condition,
                });
            }
            if enough && rank_enlargements < RANK_ENLARGEMENTS {
                rank_enlargements += 1;
                enlargements += 1;
                radius *= GROWTH;
                gather(search, x, radius, &mut scratch.neighbors);
            } else if degree > 1 {
                degree -= 1;
                rank_enlargements = 0;
            } else {
                return None;
            }
        }
    }

    /// Fills the scratch with the neighbourhood; returns its radius and how often it grew.
    fn collect(
        &self,
        search: &impl NeighborSearch<D>,
        x: &Vector<D>,
        degree: usize,
        scratch: &mut RegressionScratch<D>,
    ) -> (f64, u32) {
        let terms = term_count::<D>(degree);
        let needed = (self.minimum_ratio * terms as f64).ceil() as usize;
        match self.neighborhood {
            Neighborhood::Radius { cutoff } => {
                let mut radius = cutoff;
                let mut enlargements = 0;
                gather(search, x, radius, &mut scratch.neighbors);
                if scratch.neighbors.len() < needed {
                    // Far below what an even distribution needs, small steps would only be slow.
                    radius = radius.max(0.8 * self.spacing * radius_of_count::<D>(needed as f64));
                }
                while scratch.neighbors.len() < needed && enlargements < MOST_ENLARGEMENTS {
                    radius *= GROWTH;
                    enlargements += 1;
                    gather(search, x, radius, &mut scratch.neighbors);
                }
                (radius, enlargements)
            }
            Neighborhood::Nearest { count } => {
                let count = count.max(needed);
                let mut radius = self.spacing * (count as f64).powf(1.0 / D as f64);
                let mut tries = 0;
                gather(search, x, radius, &mut scratch.neighbors);
                while scratch.neighbors.len() < count && tries < MOST_ENLARGEMENTS {
                    radius *= 1.3;
                    tries += 1;
                    gather(search, x, radius, &mut scratch.neighbors);
                }
                // Ties are settled by the index, so the choice depends on the particles alone.
                let neighbors = &mut scratch.neighbors;
                if neighbors.len() > count {
                    neighbors.select_nth_unstable_by(count - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    neighbors.truncate(count);
                    neighbors.sort_unstable_by_key(|n| n.1);
                }
                let farthest = neighbors.iter().map(|n| n.0).fold(0.0, f64::max).sqrt();
                (farthest.max(self.spacing * 1e-3), 0)
            }
        }
    }

    /// Least squares over the collected neighbours; None when the matrix is short of rank.
    fn solve(
        &self,
        x: &Vector<D>,
        values: &[f64],
        radius: f64,
        degree: usize,
        scratch: &mut RegressionScratch<D>,
        coefficients: &mut [f64],
    ) -> Option<f64> {
        let terms = coefficients.len();
        scratch.system.reset(scratch.neighbors.len(), terms);
        scratch.row.resize(terms, 0.0);
        let unscaled = self.basis.kind() == BasisKind::MonomialUnscaled;
        let inverse = 1.0 / radius;
        for (row, (r2, j, dx)) in scratch.neighbors.iter().enumerate() {
            let local = if unscaled { x + dx } else { dx * inverse };
            self.basis.row(&local, degree, &mut scratch.row);
            let mut value = values[*j];
            if self.weight > 0.0 {
                // The square root of the weight multiplies the row.
                let w = (-0.5 * self.weight * r2 * inverse * inverse).exp();
                scratch.row.iter_mut().for_each(|a| *a *= w);
                value *= w;
            }
            scratch.system.set_row(row, &scratch.row, value);
        }
        let (found, solution) = scratch.system.solve();
        if found.rank < terms {
            return None;
        }
        coefficients.copy_from_slice(solution);
        self.basis.to_newton_form(coefficients);
        coefficients.iter().all(|c| c.is_finite()).then_some(found.condition)
    }
}

/// Radius, in spacings, of a ball that holds so many evenly distributed particles.
#[must_use]
pub fn radius_of_count<const D: usize>(count: f64) -> f64 {
    let ball = if D == 2 { std::f64::consts::PI } else { 4.0 / 3.0 * std::f64::consts::PI };
    (count / ball).powf(1.0 / D as f64)
}

fn gather<const D: usize>(
    search: &impl NeighborSearch<D>,
    x: &Vector<D>,
    radius: f64,
    neighbors: &mut Vec<(f64, usize, Vector<D>)>,
) {
    neighbors.clear();
    search.for_each_within(x, radius, |j, dx, r2| neighbors.push((r2, j, *dx)));
}

#[cfg(test)]
mod tests {
    use super::{BasisKind, Neighborhood, PolynomialBasis, Regression, RegressionScratch, Vector};
    use crate::geometry::Domain;
    use crate::geometry::lattice::Lattice;
    use crate::neighbors::CellList;
    use crate::parallel::Interrupt;

    fn cloud(jitter: f64) -> Vec<Vector<2>> {
        let lattice = Lattice { spacing: 0.1, offset: 0.0, jitter, seed: 2 };
        lattice.points_near(&Vector::<2>::repeat(-1.0), &Vector::<2>::repeat(1.0), 1.0, |_| 0.0, &Interrupt::default())
    }

    fn regression(kind: BasisKind, degree: usize, neighborhood: Neighborhood) -> Regression<2> {
        Regression {
            basis: PolynomialBasis::new(kind, degree),
            neighborhood,
            weight: 2.0,
            minimum_ratio: 1.5,
            spacing: 0.1,
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
                let fit =
                    regression.fit(&cells, &at, &values, &mut RegressionScratch::default(), &mut coefficients).unwrap();
                assert_eq!(fit.degree, 4);
                assert!(fit.neighbors >= 23, "{} neighbours", fit.neighbors);
                let x = Vector::<2>::new(0.25, -0.3);
                let exact = 1.0 + x[0] - 2.0 * x[1] * x[0] + x[1].powi(4) - x[0].powi(3);
                let value = fit.polynomial(&regression.basis, &coefficients).value(&(x - fit.centre));
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
        let fit = regression.fit(&cells, &points[20], &values, &mut RegressionScratch::default(), &mut coefficients);
        assert!(fit.is_none());
    }

    #[test]
    fn few_particles_give_a_lower_degree_and_say_so() {
        let points: Vec<Vector<2>> = cloud(0.3).into_iter().take(5).chain([Vector::<2>::new(-0.95, -0.8)]).collect();
        let values: Vec<f64> = points.iter().map(|x| x[0] + 2.0 * x[1]).collect();
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), 0.1);
        let regression = regression(BasisKind::Monomial, 4, Neighborhood::Radius { cutoff: 0.2 });
        let mut coefficients = vec![0.0; 15];
        let fit =
            regression.fit(&cells, &points[2], &values, &mut RegressionScratch::default(), &mut coefficients).unwrap();
        assert!(fit.degree <= 2 && fit.enlargements > 0);
        let x = Vector::<2>::new(-0.8, -0.9);
        let value = fit.polynomial(&regression.basis, &coefficients).value(&(x - fit.centre));
        assert!((value + 2.6).abs() < 1e-10);
    }
}
