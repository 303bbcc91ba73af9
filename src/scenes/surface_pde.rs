//! `surface_pde`: operators and equations on surfaces (Surface DC-PSE paper).

mod data_fields;
mod edges;
mod field_choices;
mod field_spec;
mod field_values;
mod methods;
mod motions;
mod points;
mod preparation;
mod problem_costs;
mod problems;
mod simulations;
mod plan;
mod solvers;
pub mod spec;
mod spread;
mod starts;
mod surface_scene;
mod surfaces;
mod transport_spec;
mod velocities;

use crate::scene::{self, Quantities, SceneKind};
use crate::schemes::embedding_closest_point::quantities as embedding;
use crate::schemes::surface_equation::{self, quantities as own};
use crate::simulation::quantity::without_repetition;
use crate::spec::Group;

/// The kind of scene named `surface_pde`.
pub static KIND: SceneKind = SceneKind {
    kind: "surface_pde",
    title: "Operators on surfaces known by points with normals (Surface DC-PSE paper)",
    presets: &[],
    example: include_str!("surface_pde/example.json"),
    declarations: spec::SurfacePde::declarations,
    parse: scene::parse_as::<spec::SurfacePde>,
    of_earlier_version: plan::of_earlier_version,
    quantities: || Quantities {
        fields: surface_equation::all_fields(),
        observables: without_repetition(&[&surface_equation::all_observables(), embedding::OBSERVABLES]),
        norms: without_repetition(&[&own::norms(), embedding::NORMS]),
    },
    calibration: include_str!("surface_pde/calibration.json"),
    precision: include_str!("surface_pde/precision.json"),
};
