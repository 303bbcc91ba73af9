//! Surfaces that are known by points: distribution of points, estimated normals, and examination of points from
//! outside.
//!
//! Points are relaxed until they are about equally far apart. Missing normals are estimated and oriented. Clouds from
//! outside are refused, or reported, where they cannot represent a surface.

pub mod bump;
pub mod cleaning;
pub mod edges;
pub mod examination;
pub mod given_normals;
mod least_turn;
pub mod local_spacing;
pub mod normals;
pub mod orientation;
pub mod periodic;
pub mod planes;
pub mod preparation;
mod rays;
pub mod relaxation;
pub mod star_graph;
pub mod stars;
pub mod triangulation;

pub use bump::Bump;
pub use examination::Examined;
pub use preparation::PreparedCloud;
pub use star_graph::StarGraph;
