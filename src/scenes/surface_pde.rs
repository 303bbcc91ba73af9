//! `surface_pde`: operators and equations on surfaces (Surface DC-PSE paper).

mod points;
mod problems;
mod plan;
pub mod spec;
mod surfaces;

use crate::scene::{self, SceneKind};
use crate::spec::Group;

/// The kind.
pub static KIND: SceneKind = SceneKind {
    kind: "surface_pde",
    title: "Operators on surfaces known by points with normals (Surface DC-PSE paper)",
    presets: &[],
    example: include_str!("surface_pde/example.json"),
    declarations: spec::SurfacePde::declarations,
    parse: scene::parse_as::<spec::SurfacePde>,
    calibration: include_str!("surface_pde/calibration.json"),
};
