//! Particle methods for moving interfaces: the engine of Meniscus.
//!
//! Data flows one way: JSON → parameters ([`scene::schema`]) → valid scene ([`scene::Scene`]) →
//! [`simulation::Simulation`] → steps → observers ([`simulation::run`]).
//!
//! The engine knows no job, no HTTP, no file path and no wall clock; it prints nothing. A simulation's future depends
//! on (scene, state) alone, for any number of threads. A module uses only modules above it in this list:

pub mod closest_point;
pub mod geometry;
pub mod linear_algebra;
pub mod neighbors;
pub mod parallel;
pub mod particles;
pub mod polynomials;
pub mod scene;
pub mod scenes;
pub mod schemes;
pub mod simulation;
pub mod time;
