//! Linear algebra: dense least squares, many small systems at once in vector lanes, and large sparse systems.
//!
//! Formulas are written once for single numbers and for vector lanes. All sums run in a fixed order.

pub mod krylov;
pub mod least_squares;
pub mod mean_term;
pub mod normal_equations;
pub mod number;
pub mod sparse_cholesky;
pub mod sparse_lu;
pub mod sparse_rows;

pub use sparse_rows::SparseRows;
