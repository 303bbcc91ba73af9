//! What frames of two fluids show: each field with its unit, its sentence and its values.

use super::config::{Geometry, SphConfig};
use super::system::SphSystem;
use super::tension_law::TensionLaw;
use crate::geometry::Vector;
use crate::simulation::fields::{
    COMMON_FIELDS, CURVATURE, FrameField, NORMAL, SURFACE_FIELDS, always_shown, quantities_of, shown_by_choice,
};
use crate::simulation::quantity::without_repetition;
use crate::simulation::{FieldValues, Fields, Quantity, Selection};

/// The fields that only this scheme has.
fn table<const D: usize>() -> [FrameField<SphConfig<D>, SphSystem<D>>; 7] {
    [
        FrameField::new(
            &Quantity { name: "velocity", unit: "length/time", doc: "Velocity of the particle." },
            |system: &SphSystem<D>| FieldValues::vectors(system.whole_velocities()),
        ),
        FrameField::new(
            &Quantity { name: "density", unit: "mass/length^D", doc: "Mass density at the particle." },
            |system: &SphSystem<D>| FieldValues::Scalar(system.flow.density.clone()),
        ),
        FrameField::new(
            &Quantity {
                name: "pressure",
                unit: "mass/(length*time^2)",
                doc: "Pressure, with the part of surface tension that it balances.",
            },
            |system: &SphSystem<D>| {
                let pressures = system.flow.pressure.iter().enumerate();
                FieldValues::Scalar(pressures.map(|(i, p)| p + system.absorbed_pressure(i)).collect())
            },
        ),
        FrameField::new(
            &Quantity { name: "phase", unit: "", doc: "Fluid of the particle: 1 inside, 0 outside." },
            |system: &SphSystem<D>| {
                FieldValues::Scalar(system.flow.species.iter().map(|species| f64::from(species.code())).collect())
            },
        ),
        FrameField::new(
            &Quantity { name: "mass", unit: "mass", doc: "Mass of the particle." },
            |system: &SphSystem<D>| {
                FieldValues::Scalar((0..system.flow.count()).map(|i| system.flow.mass(i)).collect())
            },
        )
        .only_if(|config: &SphConfig<D>| !config.fluids.have_one_mass()),
        FrameField::new(
            &Quantity {
                name: "surface_tension",
                unit: "mass*length^(3-D)/time^2",
                doc: "Surface tension at the closest point.",
            },
            |system: &SphSystem<D>| {
                let known = system.varying.as_ref().map(|varying| varying.field.tension.clone());
                FieldValues::Scalar(known.unwrap_or_default())
            },
        )
        .only_if(|config: &SphConfig<D>| config.tension_law.is_some()),
        FrameField::new(
            &Quantity {
                name: "coverage",
                unit: "",
                doc: "Share of the interface that the surfactant covers at the closest point.",
            },
            |system: &SphSystem<D>| {
                let known = system.varying.as_ref().map(|varying| varying.field.coverage.clone());
                FieldValues::Scalar(known.unwrap_or_default())
            },
        )
        .only_if(|config: &SphConfig<D>| matches!(config.tension_law, Some(TensionLaw::Surfactant(_)))),
    ]
}

/// Every field that frames of this scheme may show.
#[must_use]
pub fn all() -> Vec<&'static Quantity> {
    without_repetition(&[SURFACE_FIELDS, &quantities_of(&table::<2>()), COMMON_FIELDS])
}

/// Fields that frames show with a configuration.
#[must_use]
pub fn shown<const D: usize>(config: &SphConfig<D>) -> Vec<&'static Quantity> {
    let surface: &[&Quantity] = match config.geometry {
        _ if !config.has_tension() => &[],
        Geometry::Pcp { .. } => SURFACE_FIELDS,
        Geometry::ColorField => &[&NORMAL, &CURVATURE],
    };
    let table = table();
    without_repetition(&[surface, &always_shown(&table), &shown_by_choice(&table, config), COMMON_FIELDS])
}

/// The selected fields at the particles.
pub(super) fn frame<'a, const D: usize>(system: &SphSystem<D>, selection: Selection<'a>) -> Fields<'a> {
    let mut fields = Fields::new(system.particles.positions(), selection);
    if system.config.has_tension() {
        if system.interface.level_set().is_some() {
            fields.surface(&system.particles, &system.columns, true);
        } else {
            smoothed_color(system, &mut fields);
        }
    }
    fields.add_table(&table(), &system.config, system);
    fields.particle_id();
    fields
}

/// Normals and curvatures of the smoothed color, NaN outside the band.
fn smoothed_color<const D: usize>(system: &SphSystem<D>, fields: &mut Fields<'_>) {
    let band = system.particles.flag(system.columns.in_band);
    let (normal, curvature) =
        (system.particles.vector(system.columns.normal), system.particles.scalar(system.columns.curvature));
    let known = |i: usize, n: &Vector<D>| if band[i] == 1 { *n } else { n.map(|_| f64::NAN) };
    fields.vector(&NORMAL, || normal.iter().enumerate().map(|(i, n)| known(i, n)));
    fields.scalar(&CURVATURE, || {
        curvature.iter().zip(band).map(|(kappa, b)| if *b == 1 { *kappa } else { f64::NAN }).collect()
    });
}
