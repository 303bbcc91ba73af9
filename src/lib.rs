//! Particle methods for moving interfaces: the engine of Meniscus.
//!
//! Data flows one way: JSON → declared parameters ([`spec`]) → plan of a scene ([`scene::Scene`]) →
//! [`simulation::Simulation`] → steps → observers ([`simulation::run`]).
//!
//! The engine knows no job, no HTTP, no file path and no wall clock; it prints nothing. A simulation's future depends
//! on (scene, state) alone, for any number of threads. A module uses only modules above it in this list:

pub mod spec;
pub mod parallel;
pub mod formulas;
pub mod geometry;
pub mod linear_algebra;
pub mod smoothing_kernels;
pub mod particles;
pub mod neighbors;
pub mod polynomials;
pub mod closest_point;
pub mod point_clouds;
pub mod operators;
pub mod time;
pub mod simulation;
pub mod schemes;
pub mod scene;
pub mod scenes;
