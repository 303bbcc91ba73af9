//! `redistance`: static geometry (PCP paper, section 4.1).

mod parameters;
mod setup;

use crate::scene::SceneKind;

/// The kind.
pub static KIND: SceneKind = SceneKind {
    kind: "redistance",
    title: "Redistancing of resting particles about a known shape (PCP paper, section 4.1)",
    parameters: parameters::PARAMETERS,
    presets: &["paper"],
    preset: parameters::preset,
    example: include_str!("redistance/example.json"),
    understand: setup::understand,
    calibration: include_str!("redistance/calibration.json"),
};
