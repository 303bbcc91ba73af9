//! The grid-based particle method (GBPM paper): a moving front as the foot points of the grid points near it.
//!
//! In each step the foot points move by a law. Then every grid point near the front gets a new foot point: the closest point
//! of a local reconstruction through the moved ones.
//!
//! | file | content |
//! | --- | --- |
//! | `system`, `simulation` | the front and its steps; the simulation |
//! | `frame_fields`, `quantities` | what frames show; what series and reports show |
//! | `config`, `method` | the configuration of a front; the parameters of the method |
//! | `laws` | what moves a front, one file a law |
//! | `placement`, `corners`, `wavefront` | foot points at the start; corners that open; wave fronts of optics |
//! | `grid`, `tube`, `refinement` | the grid with its levels; grid points near a surface; which cells are split |
//! | `resampling`, `gaps`, `removals` | new foot points after a motion; particles next to gaps; counts |
//! | `reconstruction`, `reconstructor` | the closest point of a front to one place; to many places |
//! | `local_graph`, `local_shape`, `support` | polynomials over a tangent plane; their curvatures; extent of their particles |
//! | `segments`, `topology`, `sweep` | how segments are told apart; what happens where they meet; which particles are swept |
//! | `exact_front`, `errors`, `coverage` | exact motions, one file a motion; errors; gaps along chains |

mod config;
mod corners;
pub mod curvature_stability;
mod coverage;
mod errors;
mod exact_front;
#[cfg(test)]
mod fixtures;
mod foot_points;
mod format_1;
pub mod frame_fields;
mod front_watch;
mod gaps;
mod grid;
pub mod laws;
mod local_graph;
mod local_shape;
mod method;
mod placement;
pub mod quantities;
mod reconstruction;
mod reconstructor;
mod refinement;
mod removals;
mod resampling;
mod segments;
mod simulation;
mod support;
mod sweep;
mod system;
mod topology;
mod tube;
mod wavefront;

pub use config::FrontConfig;
pub use exact_front::ExactFrontMotion;
pub use foot_points::FootPoints;
pub use grid::{Grid, MOST_LEVELS};
pub use laws::FrontLaw;
pub use method::{Adaptivity, FrontMethod};
pub use removals::Removals;
pub use segments::Segments;
pub use simulation::GridBasedParticles;
pub use system::FrontSystem;
pub use topology::Topology;
pub use wavefront::EllipticalWavefront;
