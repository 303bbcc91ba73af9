//! Scene time: the clock of fixed steps and the integrators of particle paths.

pub mod clock;
pub mod integrators;

pub use clock::{Clock, FixedStep};
pub use integrators::PathIntegrator;
