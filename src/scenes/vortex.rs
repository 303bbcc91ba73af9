//! `vortex`: an interface in a prescribed flow (PCP paper, section 4.2).

mod parameters;
mod setup;

use crate::scene::SceneKind;

/// The kind.
pub static KIND: SceneKind = SceneKind {
    kind: "vortex",
    title: "An interface carried by a prescribed flow (PCP paper, section 4.2)",
    parameters: parameters::PARAMETERS,
    presets: &["paper"],
    preset: parameters::preset,
    example: include_str!("vortex/example.json"),
    understand: setup::understand,
    calibration: include_str!("vortex/calibration.json"),
};
