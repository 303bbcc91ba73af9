//! Equations on surfaces by operators on scattered points (Surface DC-PSE, section 4).
//!
//! One simulation ([`simulation`]) keeps the cloud, constructs the operators that its problem asks for and lets the problem
//! step; one file a problem.

use crate::simulation::Quantity;
use crate::simulation::fields::COMMON_FIELDS;
use crate::simulation::quantity::without_repetition;

mod advection;
mod cloud;
mod conservative;
mod curvature;
mod diffusivity;
mod eigenmodes;
mod evolution;
mod evolution_parts;
mod field_bounds;
pub mod fields;
mod formula_field;
mod formula_terms;
mod geodesic_distance;
mod format_1;
mod material_cells;
mod method;
mod motion;
mod moving_surface;
mod pointwise;
mod poisson;
mod problem;
pub mod quantities;
mod reactions;
mod row_quality;
mod shape_tensor;
mod simulation;
mod solver;
mod substances;
pub mod surface_gradient;
mod triangle_curvature;

pub use advection::{Advection, Course};
pub use cloud::{Copies, SurfaceCloud};
pub use curvature::Curvature;
pub use diffusivity::Diffusivity;
pub use eigenmodes::Eigenmodes;
pub use evolution::Evolution;
pub use evolution_parts::{EvolutionIntegrator, EvolutionParts, ExactCourse, Source};
pub use fields::ExactField;
pub use formula_field::{FormulaField, Sites, VARIABLES};
pub use formula_terms::{FormulaTerms, MOST_SPECIES};
pub use geodesic_distance::GeodesicDistance;
pub use method::{Form, Method};
pub use motion::Motion;
pub use moving_surface::{MovingParts, MovingSurface};
pub use pointwise::Pointwise;
pub use poisson::{Condition, Poisson};
pub use problem::Problem;
pub use reactions::{Model, Reaction, Terms};
pub use row_quality::RowQuality;
pub use simulation::SurfaceEquation;
pub use solver::Solver;
pub use surface_gradient::SurfaceGradient;

/// Every scalar that series may have.
#[must_use]
pub fn all_observables() -> Vec<&'static Quantity> {
    without_repetition(&[quantities::OBSERVABLES, eigenmodes::OBSERVABLES, moving_surface::OBSERVABLES])
}

/// Every field that frames of this scheme may show.
#[must_use]
pub fn all_fields() -> Vec<&'static Quantity> {
    without_repetition(&[
        &Evolution::shown_fields(MOST_SPECIES, true),
        &Advection::<3>::shown_fields(true),
        &Pointwise::shown_fields(true),
        &Poisson::shown_fields(true),
        &Curvature::shown_fields(3),
        &surface_gradient::shown_fields(),
        &GeodesicDistance::shown_fields(),
        &[&quantities::NORMAL, &quantities::CURVATURE],
        COMMON_FIELDS,
    ])
}
