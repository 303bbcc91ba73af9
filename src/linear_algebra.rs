//! Algebra: numbers in vector lanes, dense least squares, normal equations of many small problems at once, sparse rows and
//! their iterative solution.

pub mod krylov;
pub mod least_squares;
pub mod normal_equations;
pub mod number;
pub mod sparse_lu;
pub mod sparse_rows;

pub use sparse_rows::SparseRows;
