//! Equations on surfaces by operators on scattered points (Surface DC-PSE, section 4).
//!
//! One simulation ([`simulation`]) keeps the cloud, constructs the operators that its problem asks for and lets the problem
//! step; one file a problem.

mod cloud;
mod curvature;
mod evolution;
pub mod fields;
mod format_1;
mod method;
mod pointwise;
mod poisson;
mod problem;
pub mod quantities;
mod reactions;
mod simulation;
mod solver;

pub use cloud::SurfaceCloud;
pub use curvature::Curvature;
pub use evolution::{Evolution, EvolutionIntegrator, EvolutionParts, ExactCourse};
pub use fields::ExactField;
pub use method::{Form, Method};
pub use pointwise::Pointwise;
pub use poisson::{Condition, Poisson};
pub use problem::Problem;
pub use reactions::{Model, Reaction};
pub use simulation::SurfaceEquation;
pub use solver::Solver;
