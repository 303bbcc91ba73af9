//! Surfaces made of points: how they are spread, their normals, and what is wrong with them.

pub mod bump;
pub mod examination;
pub mod normals;
pub mod relaxation;

pub use bump::Bump;
pub use examination::Examined;
