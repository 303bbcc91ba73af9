//! `surface_pde`: operators and equations on surfaces (Surface DC-PSE paper).

mod parameters;
mod points;
mod problems;
mod setup;
mod surfaces;

use crate::scene::SceneKind;

/// The kind.
pub static KIND: SceneKind = SceneKind {
    kind: "surface_pde",
    title: "Operators on surfaces known by points with normals (Surface DC-PSE paper)",
    parameters: parameters::PARAMETERS,
    presets: &[],
    preset: parameters::preset,
    example: include_str!("surface_pde/example.json"),
    understand: setup::understand,
    calibration: include_str!("surface_pde/calibration.json"),
};
