//! Multivariate polynomials of bounded total degree, and their least-squares fits to scattered values.
//!
//! A fit collects a neighborhood, solves a weighted regression and gives a local polynomial with exact derivatives.
//! Four fits are solved at once in vector lanes where their moments are well conditioned, and one by one by QR
//! otherwise.

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

/// Largest total degree of a basis.
pub const MAX_DEGREE: usize = 8;

/// Largest number of basis terms, C(8 + 3, 3).
pub const MAX_TERMS: usize = 165;
