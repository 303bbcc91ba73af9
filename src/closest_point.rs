//! Closest-point redistancing on irregular particles (PCP, section 3).
//!
//! Particles next to the surface carry local polynomials of the level-set function. Their projections onto the zeros of
//! the polynomials are sample points of the surface. A query starts at the nearest sample and solves for the closest
//! point on the zero of the sample's polynomial.

mod charts;
pub mod coverage;
pub mod detection;
pub mod enclosed_moments;
pub mod level_surface;
pub mod local_map;
mod map_search;
pub mod material;
pub mod method;
pub mod metric;
pub mod newton;
pub mod projection;
pub mod queries;
pub mod redistancing;
pub mod rescue;
pub mod stretch;
pub mod stretched;
pub mod surface_columns;

pub use coverage::{Coverage, Crossings};
pub use level_surface::LevelSurface;
pub use material::MaterialSurface;
pub use method::PcpMethod;
pub use metric::CloudMetric;
pub use queries::ClosestPoints;
pub use redistancing::{ClosestPoint, Redistancing};
pub use rescue::{FitDiagnostics, RescueCounts};
pub use stretch::Stretch;
pub use stretched::StretchedSurface;
pub use surface_columns::SurfaceColumns;
