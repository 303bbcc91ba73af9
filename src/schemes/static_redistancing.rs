//! Redistancing of resting particles about a known surface (PCP, section 4.1), on the particles themselves or, as a baseline,
//! on a grid that their values are interpolated to.

mod checks;
mod errors;
mod format_1;
pub mod quantities;
mod remeshing;
mod simulation;
mod system;

pub use remeshing::{RemeshingKernel, grid_method};
pub use simulation::StaticRedistancing;
pub use system::{InitialLevel, StaticParts, StaticSystem};
