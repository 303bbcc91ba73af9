//! Surfaces that are known by points: distribution of points, estimated normals, and examination of points from
//! outside.
//!
//! Points are relaxed until they are about equally far apart. Missing normals are estimated and oriented. Clouds from
//! outside are refused, or reported, where they cannot represent a surface.

pub mod bump;
pub mod examination;
pub mod normals;
pub mod relaxation;

pub use bump::Bump;
pub use examination::Examined;
