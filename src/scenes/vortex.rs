//! `vortex`: an interface in a prescribed flow (PCP paper, section 4.2).

mod plan;
pub mod spec;

use crate::scene::{self, SceneKind};
use crate::spec::Group;

/// The kind.
pub static KIND: SceneKind = SceneKind {
    kind: "vortex",
    title: "An interface carried by a prescribed flow (PCP paper, section 4.2)",
    presets: &[("paper", spec::paper)],
    example: include_str!("vortex/example.json"),
    declarations: spec::Vortex::declarations,
    parse: scene::parse_as::<spec::Vortex>,
    calibration: include_str!("vortex/calibration.json"),
};
