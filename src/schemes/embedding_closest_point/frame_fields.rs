//! What frames of the embedding show: each field with its unit, its sentence and its values.

use super::surface_data::SurfaceData;
use crate::simulation::fields::FrameField;
use crate::simulation::{FieldValues, Fields, Quantity, Selection};

/// What a frame shows.
struct Snapshot<'a> {
    data: &'a SurfaceData,
    /// The computed values, once there are any.
    value: Option<&'a [f64]>,
}

/// The fields of frames, `particle_id` excepted.
fn table<'a>() -> [FrameField<(), Snapshot<'a>>; 5] {
    [
        FrameField::new(
            &Quantity { name: "value", unit: "of the field", doc: "Computed value; NaN before the first step." },
            |now: &Snapshot<'a>| {
                FieldValues::Scalar(now.value.map_or_else(|| vec![f64::NAN; now.data.points.len()], <[f64]>::to_vec))
            },
        ),
        FrameField::new(
            &Quantity { name: "field", unit: "of the field", doc: "Given field." },
            |now: &Snapshot<'a>| FieldValues::Scalar(now.data.field.clone()),
        ),
        FrameField::new(
            &Quantity { name: "reference", unit: "of the field", doc: "Exact value at the point." },
            |now: &Snapshot<'a>| FieldValues::Scalar(now.data.reference.clone()),
        ),
        FrameField::new(
            &Quantity { name: "normal", unit: "", doc: "Unit normal at the point, outward." },
            |now: &Snapshot<'a>| FieldValues::vectors(now.data.normals.iter().copied()),
        ),
        FrameField::new(
            &Quantity { name: "curvature", unit: "1/length", doc: "Exact divergence of the unit normal at the point." },
            |now: &Snapshot<'a>| FieldValues::Scalar(now.data.curvatures.clone()),
        ),
    ]
}

/// The selected fields at the points; `value` once it is computed.
pub(super) fn frame<'a>(data: &SurfaceData, value: Option<&[f64]>, selection: Selection<'a>) -> Fields<'a> {
    let mut fields = Fields::new(&data.points, selection);
    fields.add_table(&table(), &(), &Snapshot { data, value });
    fields.particle_id();
    fields
}
