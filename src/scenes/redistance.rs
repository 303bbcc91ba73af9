//! `redistance`: static geometry (PCP, section 4.1).

mod cloud_spacing;
mod plan;
pub mod spec;

use crate::scene::{self, Quantities, SceneKind};
use crate::schemes::static_redistancing::quantities as own;
use crate::spec::Group;

/// The kind of scene named `redistance`.
pub static KIND: SceneKind = SceneKind {
    kind: "redistance",
    title: "Redistancing of resting particles about a known shape (PCP paper, section 4.1)",
    presets: &[("paper", spec::paper)],
    example: include_str!("redistance/example.json"),
    declarations: spec::Redistance::declarations,
    parse: scene::parse_as::<spec::Redistance>,
    of_earlier_version: scene::unchanged,
    quantities: || Quantities {
        fields: own::fields(),
        observables: own::OBSERVABLES.to_vec(),
        norms: own::NORMS.to_vec(),
    },
    calibration: include_str!("redistance/calibration.json"),
    precision: include_str!("redistance/precision.json"),
};
