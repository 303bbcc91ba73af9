//! The kinds of scenes, one folder each. Schemas, validation, documentation and the tests that every scene must pass
//! come from [`SCENES`].

mod curvature_stability;
mod dimension;
pub mod droplet;
mod flow_work;
mod flows;
pub mod front;
mod gbpm_parameters;
pub mod particle_estimate;
pub mod pcp_parameters;
pub mod redistance;
pub mod shapes;
pub mod surface_pde;
pub mod vortex;
pub mod work_estimate;

use crate::scene::SceneKind;

/// Every kind of scene.
pub static SCENES: &[&SceneKind] =
    &[&redistance::KIND, &vortex::KIND, &droplet::KIND, &surface_pde::KIND, &front::KIND];

/// A kind by its name.
#[must_use]
pub fn find(kind: &str) -> Option<&'static SceneKind> {
    SCENES.iter().copied().find(|k| k.kind == kind)
}
