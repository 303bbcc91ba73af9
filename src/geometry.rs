//! Domains, exact surfaces, prescribed flows and seeded point lattices.
//!
//! Surfaces give the distance, closest point, normal and curvature of any query point, exact to round-off. Scenes start
//! from them, and errors are measured against them.

pub mod block;
mod box_tree;
pub mod dimension;
pub mod domain;
pub mod fibonacci;
pub mod formula_level;
pub mod flows;
pub mod frame;
pub mod lattice;
pub mod level;
pub mod random;
pub mod surfaces;

pub use domain::Domain;
pub use flows::Flow;
pub use surfaces::{Surface, SurfacePoint};

/// A point or a vector of `D` components. All quantities of a scene are dimensionless.
pub type Vector<const D: usize> = nalgebra::SVector<f64, D>;

/// A place as messages show it.
#[must_use]
pub fn shown<const D: usize>(x: &Vector<D>) -> String {
    let numbers: Vec<String> = x.iter().map(|c| format!("{c:.4}")).collect();
    format!("({})", numbers.join(", "))
}
