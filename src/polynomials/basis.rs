//! Polynomial bases as products of one-dimensional Newton factors u_k(x) = ∏_{j<k} (x − p_j).
//!
//! Monomials are the case p_j = 0. The minter basis (PCP 3.1; Hecht 2020) is the Lagrange basis of the unisolvent
//! nodes, a triangular combination of Newton factors. A regression uses the values of its basis. Its result is expanded
//! into monomials of the centered and scaled coordinates, so that one fast evaluation serves all bases. Since indices
//! are graded, the leading terms form the basis of lower degree.

use super::horner::nested_indices;
use super::multi_index::MultiIndexSet;
use super::unisolvent_nodes::{lagrange_in_newton_form, leja_ordered_chebyshev_lobatto};
use super::{MAX_DEGREE, MAX_TERMS};
use crate::geometry::Vector;

/// The basis in which a regression is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BasisKind {
    /// Lagrange polynomials on Chebyshev–Lobatto unisolvent nodes of total degree, in Newton form.
    Minter,
    /// Monomials of coordinates that are centered and scaled by the radius of the neighborhood.
    Monomial,
    /// Monomials of raw coordinates, for the comparison of PCP fig. 6.
    MonomialUnscaled,
}

/// A basis of all polynomials in `D` variables up to a total degree.
///
/// ```
/// use meniscus::geometry::Vector;
/// use meniscus::polynomials::{BasisKind, PolynomialBasis};
///
/// let basis = PolynomialBasis::<2>::new(BasisKind::Minter, 2);
/// let mut row = [0.0; 6];
/// basis.row(&Vector::<2>::new(0.3, -0.2), 2, &mut row);
/// // Lagrange polynomials sum to one.
/// assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-14);
/// ```
#[derive(Debug, Clone)]
pub struct PolynomialBasis<const D: usize> {
    kind: BasisKind,
    degree: usize,
    set: MultiIndexSet<D>,
    /// Generating nodes p_0 … p_{n−1}.
    nodes: [f64; MAX_DEGREE],
    /// Matrix whose row α is the Lagrange polynomial L_α in Newton factors; empty for monomials.
    lagrange: Vec<f64>,
    /// Matrix whose row β is the Newton factor N_β in monomials; empty for monomials.
    expansion: Vec<f64>,
    /// Position in nested order (see [`super::horner`]) of each graded index.
    nested: Vec<usize>,
}

/// Values of the one-dimensional factors u_0 … u_n at one coordinate.
type Factors = [f64; MAX_DEGREE + 1];

impl<const D: usize> PolynomialBasis<D> {
    /// The basis of the given kind and total degree, `1 ≤ degree ≤ 8`.
    #[must_use]
    pub fn new(kind: BasisKind, degree: usize) -> Self {
        let set = MultiIndexSet::total_degree(degree);
        let mut nodes = [0.0; MAX_DEGREE];
        let mut lagrange = Vec::new();
        let mut expansion = Vec::new();
        if kind == BasisKind::Minter {
            let generating = leja_ordered_chebyshev_lobatto(degree);
            nodes[..degree].copy_from_slice(&generating[..degree]);
            lagrange = lagrange_in_newton_form(&set, &generating);
            expansion = newton_factors_in_monomials(&set, &nodes);
        }
        let places = nested_indices::<D>(degree);
        let nested = set.indices().iter().filter_map(|index| places.iter().position(|other| other == index)).collect();
        Self { kind, degree, set, nodes, lagrange, expansion, nested }
    }

    /// Kind of the basis.
    #[must_use]
    pub fn kind(&self) -> BasisKind {
        self.kind
    }

    /// Total degree of the basis.
    #[must_use]
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Multi-indices in graded order.
    fn indices(&self) -> &[[u8; D]] {
        self.set.indices()
    }

    /// Newton factors of one coordinate up to a degree.
    fn factors(&self, x: f64, degree: usize) -> Factors {
        let mut u = [0.0; MAX_DEGREE + 1];
        u[0] = 1.0;
        for k in 0..degree {
            u[k + 1] = u[k] * (x - self.nodes[k]);
        }
        u
    }

    /// Writes the values of the first `row.len()` basis functions at the local coordinates `x`, one row of a
    /// regression.
    ///
    /// `degree` is the total degree that belongs to `row.len()` terms.
    pub fn row(&self, x: &Vector<D>, degree: usize, row: &mut [f64]) {
        let terms = row.len();
        let mut newton = [0.0; MAX_TERMS];
        let factors: [Factors; D] = std::array::from_fn(|d| self.factors(x[d], degree));
        for (value, index) in newton[..terms].iter_mut().zip(self.indices()) {
            *value = (0..D).map(|d| factors[d][index[d] as usize]).product();
        }
        if self.lagrange.is_empty() {
            row.copy_from_slice(&newton[..terms]);
            return;
        }
        let stride = self.indices().len();
        for (alpha, value) in row.iter_mut().enumerate() {
            // L_α combines the Newton factors from α on. Truncated at `terms` it is the Lagrange basis of lower degree.
            let coefficients = &self.lagrange[alpha * stride + alpha..alpha * stride + terms];
            *value = coefficients.iter().zip(&newton[alpha..terms]).map(|(c, v)| c * v).sum();
        }
    }

    /// Expands a polynomial into monomials of the same coordinates.
    ///
    /// - `coefficients`: in this basis and graded order, possibly of a lower degree; overwritten.
    /// - `monomials`: receives the coefficients in nested order, with zeros beyond the degree.
    pub fn expand(&self, coefficients: &mut [f64], monomials: &mut [f64]) {
        let terms = coefficients.len();
        let stride = self.indices().len();
        if !self.lagrange.is_empty() {
            for beta in (0..terms).rev() {
                coefficients[beta] =
                    (0..=beta).map(|alpha| coefficients[alpha] * self.lagrange[alpha * stride + beta]).sum();
            }
            for gamma in 0..terms {
                coefficients[gamma] =
                    (gamma..terms).map(|beta| coefficients[beta] * self.expansion[beta * stride + gamma]).sum();
            }
        }
        monomials.fill(0.0);
        for (coefficient, place) in coefficients.iter().zip(&self.nested) {
            monomials[*place] = *coefficient;
        }
    }
}

/// Matrix, by rows, that expands the Newton factors ∏_d ∏_{j < β_d} (x_d − p_j) in monomials. It is lower triangular
/// for graded indices.
fn newton_factors_in_monomials<const D: usize>(set: &MultiIndexSet<D>, nodes: &[f64; MAX_DEGREE]) -> Vec<f64> {
    // One-dimensional factors: u_{k+1} = (x − p_k) u_k.
    let mut factors = [[0.0; MAX_DEGREE + 1]; MAX_DEGREE + 1];
    factors[0][0] = 1.0;
    for k in 0..MAX_DEGREE {
        for m in 0..=k {
            factors[k + 1][m + 1] += factors[k][m];
            factors[k + 1][m] -= nodes[k] * factors[k][m];
        }
    }
    let indices = set.indices();
    let mut matrix = Vec::with_capacity(indices.len() * indices.len());
    for beta in indices {
        matrix.extend(
            indices.iter().map(|gamma| (0..D).map(|d| factors[beta[d] as usize][gamma[d] as usize]).product::<f64>()),
        );
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::{BasisKind, PolynomialBasis, Vector};

    #[test]
    fn lower_degrees_of_the_minter_basis_are_lagrange_bases_of_their_own() {
        let basis = PolynomialBasis::<2>::new(BasisKind::Minter, 5);
        for degree in 1..=5 {
            let terms = crate::polynomials::multi_index::term_count::<2>(degree);
            for (a, alpha) in basis.indices()[..terms].iter().enumerate() {
                let generating = super::leja_ordered_chebyshev_lobatto(5);
                let x = Vector::<2>::new(generating[alpha[0] as usize], generating[alpha[1] as usize]);
                let mut row = vec![0.0; terms];
                basis.row(&x, degree, &mut row);
                for (b, value) in row.iter().enumerate() {
                    assert!((value - f64::from(u8::from(a == b))).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn expansion_into_monomials_keeps_the_polynomial() {
        let random = crate::geometry::random::CounterRandom::new(3);
        let x = Vector::<3>::new(0.3, -0.8, 0.55);
        let monomials = PolynomialBasis::<3>::new(BasisKind::Monomial, 6);
        for (kind, degree) in [(BasisKind::Minter, 6), (BasisKind::Minter, 3), (BasisKind::Monomial, 4)] {
            let basis = PolynomialBasis::<3>::new(kind, 6);
            let terms = crate::polynomials::multi_index::term_count::<3>(degree);
            let mut coefficients: Vec<f64> = (0..terms).map(|k| random.symmetric(&[k as i64])).collect();
            let (mut row, mut expanded) = (vec![0.0; terms], vec![0.0; 84]);
            basis.row(&x, degree, &mut row);
            let value: f64 = row.iter().zip(&coefficients).map(|(r, c)| r * c).sum();
            basis.expand(&mut coefficients, &mut expanded);
            let mut graded = vec![0.0; 84];
            monomials.row(&x, 6, &mut graded);
            let again: f64 = graded.iter().zip(&basis.nested).map(|(r, place)| r * expanded[*place]).sum();
            assert!((again - value).abs() < 1e-12, "{kind:?}: {again} for {value}");
        }
    }

    #[test]
    fn lagrange_polynomials_sum_to_one() {
        let basis = PolynomialBasis::<3>::new(BasisKind::Minter, 4);
        let mut row = vec![0.0; 35];
        basis.row(&Vector::<3>::new(0.3, -0.7, 0.11), 4, &mut row);
        assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
