//! What frames of a front show: each field with its unit, its sentence and its values.

use super::grid::Grid;
use super::segments::Segments;
use super::system::FrontSystem;
use crate::geometry::Vector;
use crate::simulation::fields::{COMMON_FIELDS, FrameField, always_shown, quantities_of, shown_by_choice};
use crate::simulation::quantity::without_repetition;
use crate::simulation::{FieldValues, Fields, Quantity, Selection};
use crate::time::Clock;

/// What decides which fields there are.
struct Shape {
    /// Whether the front is a surface, not a curve in the plane or in space.
    is_surface: bool,
    has_parameter: bool,
}

impl Shape {
    fn new(dimension: usize, is_curve_in_space: bool, segments: &Segments) -> Self {
        Self { is_surface: dimension == 3 && !is_curve_in_space, has_parameter: segments.parameter.is_some() }
    }
}

/// What a frame shows.
struct Snapshot<'a, const D: usize, const M: usize> {
    system: &'a FrontSystem<D, M>,
    clock: Clock,
}

impl<const D: usize, const M: usize> Snapshot<'_, D, M> {
    fn velocity(&self, i: usize) -> Vector<D> {
        self.system.config.law.velocity(&self.system.feet, i, self.clock.time)
    }
}

/// The fields of a front, `particle_id` excepted.
fn table<'a, const D: usize, const M: usize>() -> [FrameField<Shape, Snapshot<'a, D, M>>; 8] {
    [
        FrameField::new(
            &Quantity {
                name: "normal",
                unit: "",
                doc: "Unit normal of the front, outward; of a wave front its direction of travel.",
            },
            |now: &Snapshot<'a, D, M>| {
                let normals = &now.system.feet.normals;
                if D - M != 2 {
                    return FieldValues::vectors(normals.iter().copied());
                }
                let travel = |i: usize| now.velocity(i).try_normalize(0.0).unwrap_or(normals[i]);
                FieldValues::vectors((0..normals.len()).map(travel))
            },
        ),
        FrameField::new(
            &Quantity { name: "curvature", unit: "1/length", doc: "Divergence of the unit normal." },
            |now: &Snapshot<'a, D, M>| FieldValues::Scalar(now.system.feet.curvatures.clone()),
        ),
        FrameField::new(
            &Quantity { name: "gauss_curvature", unit: "1/length^2", doc: "Product of the principal curvatures." },
            |now: &Snapshot<'a, D, M>| {
                // Shapes do not tell their Gauss curvature.
                let known = |value: &f64| if now.clock.step > 0 { *value } else { f64::NAN };
                FieldValues::Scalar(now.system.feet.gauss_curvatures.iter().map(known).collect())
            },
        )
        .only_if(|shape| shape.is_surface),
        FrameField::new(
            &Quantity { name: "velocity", unit: "length/time", doc: "Velocity of the front at the particle." },
            |now: &Snapshot<'a, D, M>| FieldValues::vectors((0..now.system.feet.len()).map(|i| now.velocity(i))),
        ),
        FrameField::new(
            &Quantity { name: "grid_point", unit: "length", doc: "Grid point whose closest point the particle is." },
            |now: &Snapshot<'a, D, M>| {
                let grid = now.system.config.grid;
                FieldValues::vectors(now.system.feet.nodes.iter().map(|node| grid.place::<D>(*node)))
            },
        ),
        FrameField::new(
            &Quantity { name: "level", unit: "", doc: "Level of refinement of the grid point." },
            |now: &Snapshot<'a, D, M>| {
                FieldValues::Scalar(now.system.feet.nodes.iter().map(|node| f64::from(Grid::level(*node))).collect())
            },
        ),
        FrameField::new(
            &Quantity {
                name: "parameter",
                unit: "",
                doc: "Position along its closed part of the front at the start, from 0 to 1.",
            },
            |now: &Snapshot<'a, D, M>| FieldValues::Scalar(now.system.feet.parameters.clone()),
        )
        .only_if(|shape| shape.has_parameter),
        FrameField::new(
            &Quantity { name: "segment", unit: "", doc: "Number of its closed part of the front at the start." },
            |now: &Snapshot<'a, D, M>| {
                FieldValues::Scalar(now.system.feet.parts.iter().map(|part| f64::from(*part)).collect())
            },
        ),
    ]
}

/// Every field that frames of this scheme may show.
#[must_use]
pub fn all() -> Vec<&'static Quantity> {
    without_repetition(&[&quantities_of(&table::<2, 1>()), COMMON_FIELDS])
}

/// Fields of frames of a surface or curve in D dimensions; `is_curve_in_space` for wave fronts.
#[must_use]
pub fn shown(dimension: usize, is_curve_in_space: bool, segments: &Segments) -> Vec<&'static Quantity> {
    let shape = Shape::new(dimension, is_curve_in_space, segments);
    let table = table::<2, 1>();
    without_repetition(&[&always_shown(&table), COMMON_FIELDS, &shown_by_choice(&table, &shape)])
}

/// The selected fields at the particles.
pub(super) fn frame<'a, const D: usize, const M: usize>(
    system: &FrontSystem<D, M>,
    clock: Clock,
    selection: Selection<'a>,
) -> Fields<'a> {
    let mut fields = Fields::new(&system.feet.positions, selection);
    let shape = Shape::new(D, D - M == 2, &system.config.segments);
    fields.add_table(&table::<D, M>(), &shape, &Snapshot { system, clock });
    fields.particle_id();
    fields
}
