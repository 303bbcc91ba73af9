//! A level set carried by particles through a prescribed flow (PCP, section 4.2).

mod enclosed_watch;
mod errors;
mod format_1;
pub mod frame_fields;
pub mod quantities;
mod reach_watch;
mod simulation;
mod system;

pub use simulation::AdvectedLevelSet;
pub use system::{AdvectedParts, AdvectedSystem, FieldChoice, RedistanceWhen, Start};
