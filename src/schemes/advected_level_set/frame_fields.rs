//! What frames of an advected level set show: each field with its unit, its sentence and its values.

use super::system::{AdvectedSystem, FieldChoice};
use crate::particles::Particles;
use crate::simulation::fields::{COMMON_FIELDS, FrameField, SURFACE_FIELDS, always_shown, shown_by_choice};
use crate::simulation::quantity::without_repetition;
use crate::simulation::{FieldValues, Fields, Quantity, Selection};

/// What a frame shows.
struct Snapshot<'a, const D: usize> {
    system: &'a AdvectedSystem<D>,
    /// The particles, redistanced.
    particles: &'a Particles<D>,
    time: f64,
}

/// The fields that only this scheme has.
fn table<'a, const D: usize>() -> [FrameField<FieldChoice, Snapshot<'a, D>>; 2] {
    [
        FrameField::new(
            &Quantity { name: "psi", unit: "length", doc: "Level that the particle carries unchanged." },
            |now: &Snapshot<'a, D>| FieldValues::Scalar(now.particles.scalar(now.system.psi).to_vec()),
        )
        .only_if(|choice| *choice == FieldChoice::Dual),
        FrameField::new(
            &Quantity { name: "velocity", unit: "length/time", doc: "Velocity of the flow at the particle." },
            |now: &Snapshot<'a, D>| {
                let flow = now.system.motion.flow();
                FieldValues::vectors(now.particles.positions().iter().map(|x| flow.velocity(x, now.time)))
            },
        ),
    ]
}

/// Fields that frames show with a choice.
#[must_use]
pub fn shown(choice: FieldChoice) -> Vec<&'static Quantity> {
    let table = table::<2>();
    without_repetition(&[SURFACE_FIELDS, &always_shown(&table), COMMON_FIELDS, &shown_by_choice(&table, &choice)])
}

/// The selected fields at redistanced particles.
pub(super) fn frame<'a, const D: usize>(
    system: &AdvectedSystem<D>,
    particles: &Particles<D>,
    time: f64,
    selection: Selection<'a>,
) -> Fields<'a> {
    let mut fields = Fields::new(particles.positions(), selection);
    fields.surface(particles, &system.columns, true);
    fields.add_table(&table(), &system.parts.field, &Snapshot { system, particles, time });
    fields.particle_id();
    fields
}
