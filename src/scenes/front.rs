//! `front`: geometric motion by the grid-based particle method (GBPM paper).

mod choice;
mod law;
mod method;
mod plan;
pub mod spec;
mod wavefront;

pub(super) use choice::FrontChoice;
pub(super) use plan::plan_front;
pub(super) use spec::Law;

use crate::scene::{self, Quantities, SceneKind};
use crate::schemes::grid_based_particle::{frame_fields, quantities as own};
use crate::spec::Group;

/// The kind of scene named `front`.
pub static KIND: SceneKind = SceneKind {
    kind: "front",
    title: "A front moved by a flow, along its normal or by its curvature, as grid-based particles (GBPM paper)",
    presets: &[("paper", spec::paper)],
    example: include_str!("front/example.json"),
    declarations: spec::Front::declarations,
    parse: scene::parse_as::<spec::Front>,
    of_earlier_version: scene::unchanged,
    quantities: || Quantities {
        fields: frame_fields::all(),
        observables: own::OBSERVABLES.to_vec(),
        norms: own::norms(),
    },
    calibration: include_str!("front/calibration.json"),
    precision: "[]",
};
