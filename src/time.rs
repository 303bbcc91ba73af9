//! Scene time: the clock of fixed steps, and integrators of particle paths and of systems of equations.
//!
//! Integrators of paths advance one point in a prescribed flow. The embedded pair advances a whole system with an
//! estimate of its error.

pub mod clock;
pub mod embedded_pair;
pub mod integrators;

pub use clock::{Clock, FixedStep, Pace};
pub use integrators::PathIntegrator;
