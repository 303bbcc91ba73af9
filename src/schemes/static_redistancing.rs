//! Redistancing of resting particles about a known surface (PCP paper, section 4.1).

mod simulation;
mod system;

pub use simulation::StaticRedistancing;
pub use system::{InitialLevel, StaticSystem};
