//! `droplet`: two fluids with surface tension (PCP, sections 4.3 and 4.4, appendix B).

mod carving;
mod cases;
mod costs;
mod dimensionless;
mod flow;
mod formulation;
mod given_wall;
mod hydrostatic;
mod layer;
mod numbers;
mod obstacles;
mod own_motion;
mod plan;
mod preset;
mod room;
mod shear;
pub mod spec;
mod start_lattice;
mod start_levels;
mod steps;
mod stirring;
mod varying_tension;
mod vectors;

use crate::scene::{self, Quantities, SceneKind};
use crate::schemes::weakly_compressible_sph::{frame_fields, quantities as own};
use crate::spec::{Given, Group};

/// The kind of scene named `droplet`.
pub static KIND: SceneKind = SceneKind {
    kind: "droplet",
    title: "Two fluids with surface tension: oscillating, dividing and resting drops (PCP paper, sections 4.3 and 4.4)",
    presets: &[("paper", preset::paper)],
    example: include_str!("droplet/example.json"),
    declarations: spec::Droplet::declarations,
    parse: |given, errors| {
        let implied = dimensionless::implied(Given::new(given));
        scene::parse_as::<spec::Droplet>(&implied.under(given.clone()), errors)
    },
    of_earlier_version: formulation::of_earlier_version,
    quantities: || Quantities {
        fields: frame_fields::all(),
        observables: own::OBSERVABLES.to_vec(),
        norms: own::norms(),
    },
    calibration: include_str!("droplet/calibration.json"),
    precision: include_str!("droplet/precision.json"),
};
