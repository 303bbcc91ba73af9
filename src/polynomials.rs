//! Multivariate polynomials of bounded total degree and their least-squares fits to scattered values.

pub mod basis;
pub mod horner;
pub mod local_polynomial;
pub mod moments;
pub mod multi_index;
pub mod neighborhood;
pub mod regression;
pub mod unisolvent_nodes;

pub use basis::{BasisKind, PolynomialBasis};
pub use local_polynomial::{Jet, LocalPolynomial};
pub use multi_index::MultiIndexSet;
pub use neighborhood::Neighborhood;
pub use regression::{Fit, FitData, Regression, RegressionScratch, Solver};

/// The largest total degree that a basis can have.
pub const MAX_DEGREE: usize = 8;

/// The largest number of basis terms: C(8 + 3, 3).
pub const MAX_TERMS: usize = 165;
