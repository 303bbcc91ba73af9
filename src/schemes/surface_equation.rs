//! Equations on surfaces by operators on scattered points.

pub mod fields;
mod pointwise;

pub use fields::ExactField;
pub use pointwise::{PointwiseOperator, PointwiseParts, SurfacePoints};
