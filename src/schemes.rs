//! Methods: one folder each, with the same inner names. `system` holds the data, `quantities` declares what frames, series and
//! reports show, `simulation` is the one `impl Simulation`, and `format_1` reads old checkpoints. No scheme uses another's inside.

pub mod advected_level_set;
pub mod capillary_wave;
pub mod embedding_closest_point;
pub mod exact_motion;
pub mod flow_divergence;
pub mod front_stretch;
pub mod grid_based_particle;
pub mod measured_errors;
pub mod measured_redistancing;
pub mod static_redistancing;
pub mod surface_equation;
pub mod weakly_compressible_sph;
