//! `vortex`: an interface in a prescribed flow (PCP, section 4.2).

mod plan;
pub mod spec;

use crate::scene::{self, Quantities, SceneKind};
use crate::schemes::advected_level_set::FieldChoice;
use crate::schemes::{advected_level_set, grid_based_particle};
use crate::simulation::quantity::without_repetition;
use crate::spec::Group;

/// The kind of scene named `vortex`.
pub static KIND: SceneKind = SceneKind {
    kind: "vortex",
    title: "An interface carried by a prescribed flow (PCP paper, section 4.2)",
    presets: &[("paper", spec::paper)],
    example: include_str!("vortex/example.json"),
    declarations: spec::Vortex::declarations,
    parse: scene::parse_as::<spec::Vortex>,
    of_earlier_version: scene::unchanged,
    quantities: || Quantities {
        fields: without_repetition(&[
            &advected_level_set::frame_fields::shown(FieldChoice::Dual),
            &grid_based_particle::frame_fields::all(),
        ]),
        observables: without_repetition(&[
            advected_level_set::quantities::OBSERVABLES,
            grid_based_particle::quantities::OBSERVABLES,
        ]),
        norms: without_repetition(&[advected_level_set::quantities::NORMS, &grid_based_particle::quantities::norms()]),
    },
    calibration: include_str!("vortex/calibration.json"),
    precision: include_str!("vortex/precision.json"),
};
