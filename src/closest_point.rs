//! Closest-point redistancing on irregular particles (PCP paper, section 3).
//!
//! Particles near the surface carry local polynomials of the level-set function; projecting the particles onto the
//! zeros gives sample particles; queries start at the nearest sample and solve for the closest point of its
//! polynomial's zero.

pub mod detection;
pub mod enclosed_moments;
pub mod level_surface;
pub mod material;
pub mod method;
pub mod newton;
pub mod projection;
pub mod queries;
pub mod redistancing;
pub mod rescue;
pub mod surface_columns;

pub use level_surface::LevelSurface;
pub use material::MaterialSurface;
pub use method::PcpMethod;
pub use queries::ClosestPoints;
pub use redistancing::{ClosestPoint, Redistancing};
pub use rescue::{FitDiagnostics, RescueCounts};
pub use surface_columns::SurfaceColumns;
