//! `front`: geometric motion by the grid-based particle method (GBPM paper).

mod parameters;
mod setup;
mod wavefront;

pub(super) use parameters::Law;
pub(super) use setup::{FrontChoice, understand_choice};

use crate::scene::SceneKind;

/// The kind.
pub static KIND: SceneKind = SceneKind {
    kind: "front",
    title: "A front moved by a flow, along its normal or by its curvature, as grid-based particles (GBPM paper)",
    parameters: parameters::PARAMETERS,
    presets: &["paper"],
    preset: parameters::preset,
    example: include_str!("front/example.json"),
    understand: setup::understand,
    calibration: include_str!("front/calibration.json"),
};
