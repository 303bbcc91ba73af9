//! Methods: one folder each, with the same inner names. `system` holds the data, `simulation` the one
//! `impl Simulation`; no scheme uses another's inside.

pub mod advected_level_set;
pub mod embedding_closest_point;
pub mod exact_motion;
pub mod front_stretch;
pub mod grid_based_particle;
pub mod measured_errors;
pub mod measured_redistancing;
pub mod static_redistancing;
pub mod surface_equation;
pub mod weakly_compressible_sph;
