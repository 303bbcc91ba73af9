//! `droplet`: two fluids with surface tension (PCP paper, sections 4.3 and 4.4, appendix B).

mod cases;
mod flow;
mod parameters;
mod setup;

use crate::scene::SceneKind;

/// The kind.
pub static KIND: SceneKind = SceneKind {
    kind: "droplet",
    title: "Two fluids with surface tension: oscillating, dividing and resting drops (PCP paper, sections 4.3 and 4.4)",
    parameters: parameters::PARAMETERS,
    presets: &["paper"],
    preset: parameters::preset,
    example: include_str!("droplet/example.json"),
    understand: setup::understand,
    calibration: include_str!("droplet/calibration.json"),
};
