//! Small dense algebra: numbers in vector lanes, least squares, normal equations of many small problems at once.

pub mod least_squares;
pub mod normal_equations;
pub mod number;
