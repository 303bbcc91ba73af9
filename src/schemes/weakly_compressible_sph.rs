//! Two-phase flow by weakly compressible SPH with surface tension (PCP paper, sections 4.3 and 4.4, appendix B).
//!
//! Data flows one way within an evaluation: positions → neighbours → interface → densities and pressures → forces.

mod body_force;
mod color_field;
mod column;
mod components;
mod continuity;
mod dcpse;
mod density;
pub mod fluids;
mod format_1;
mod hydrodynamics;
mod interface;
mod kernel_choice;
mod momentum;
mod monitors;
mod pair_sums;
pub mod parts;
pub mod quantities;
mod shifting;
mod simulation;
mod stepping;
mod strays;
mod summary;
mod system;
pub mod time_step;

pub use body_force::BodyForce;
pub use fluids::Fluid;
pub use kernel_choice::KernelChoice;
pub use parts::{DensityMethod, Discretization, Geometry, Integrator, SphParts, TensionForce};
pub use simulation::{WeaklyCompressibleSph, measurement_interval};
pub use system::{Drop, SphSystem};

#[cfg(test)]
mod tests;
