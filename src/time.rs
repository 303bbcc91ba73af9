//! Scene time: the clock of fixed steps, the integrators of particle paths and of systems of equations.

pub mod clock;
pub mod embedded_pair;
pub mod integrators;

pub use clock::{Clock, FixedStep};
pub use integrators::PathIntegrator;
