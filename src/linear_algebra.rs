//! Small dense problems that are solved once per particle.

pub mod least_squares;
pub mod small_system;
