//! The grid-based particle method (GBPM paper): a moving front as foot-points of the grid points near it.
//!
//! Foot-points move by a law; then every grid point near the front gets the closest point of a local reconstruction
//! through the moved ones as its new foot-point.

mod corners;
mod exact;
mod foot_points;
mod grid;
mod local_graph;
mod method;
mod motion;
mod reconstruction;
mod refinement;
mod resampling;
mod segments;
mod simulation;
mod system;
mod topology;
mod wavefront;

pub use exact::ExactFrontMotion;
pub use foot_points::FootPoints;
pub use grid::{Grid, MOST_LEVELS};
pub use method::FrontMethod;
pub use motion::Law;
pub use refinement::Adaptivity;
pub use resampling::Removals;
pub use segments::Segments;
pub use simulation::GridBasedParticles;
pub use system::{FrontParts, FrontSystem};
pub use topology::Topology;
pub use wavefront::EllipticalWavefront;
