//! Where things are: the domain, exact surfaces, prescribed flows and seeded point lattices.

pub mod domain;
pub mod fibonacci;
pub mod flows;
pub mod frame;
pub mod lattice;
pub mod random;
pub mod surfaces;

pub use domain::Domain;
pub use flows::Flow;
pub use surfaces::{Surface, SurfacePoint};

/// A point or a vector of `D` components, dimensionless as everything in a scene.
pub type Vector<const D: usize> = nalgebra::SVector<f64, D>;
