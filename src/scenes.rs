//! The kinds of scenes, one folder each. Schemas, validation, documentation and the tests that every scene must pass
//! come from [`SCENES`].

pub mod droplet;
mod flow_data;
mod flow_return;
mod flow_work;
pub mod integrators;
pub mod front;
pub mod gbpm_spec;
pub mod particle_estimate;
pub mod pcp_spec;
pub mod redistance;
pub mod shapes;
pub mod surface_pde;
pub mod vortex;
pub mod work_estimate;

use crate::scene::SceneKind;
use crate::spec::Json;

/// Every kind of scene.
pub static SCENES: &[&SceneKind] =
    &[&redistance::KIND, &vortex::KIND, &droplet::KIND, &surface_pde::KIND, &front::KIND];

/// A kind by its name.
#[must_use]
pub fn find(kind: &str) -> Option<&'static SceneKind> {
    SCENES.iter().copied().find(|k| k.kind == kind)
}

/// The kind of a scene's JSON.
#[must_use]
pub fn kind_of(scene: &Json) -> Option<&'static SceneKind> {
    scene.get("kind").and_then(Json::as_str).and_then(find)
}
