//! Values at points from outside: which parameters take some, and the values in the order of the points of a run.

use super::field_spec::{FieldChoice, FieldValue, InitialChoice, OwnField};
use super::spec::{EdgesChoice, ModelChoice, ProblemSpec, SurfaceChoice, SurfacePde};
use crate::scene::cloud::{Cloud, CloudReference, CloudRole, CloudSizes, Clouds, PointsSource};
use crate::schemes::surface_equation::MOST_SPECIES;
use crate::spec::{Parameter, Violation};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Where the substances of a reaction begin.
pub(super) const STARTS: [&str; MOST_SPECIES] = [
    "/problem/model/initial/0",
    "/problem/model/initial/1",
    "/problem/model/initial/2",
    "/problem/model/initial/3",
    "/problem/model/initial/4",
    "/problem/model/initial/5",
];
/// Where their diffusivities stand.
pub(super) const DIFFUSIVITIES: [&str; MOST_SPECIES] = [
    "/problem/model/diffusivities/0",
    "/problem/model/diffusivities/1",
    "/problem/model/diffusivities/2",
    "/problem/model/diffusivities/3",
    "/problem/model/diffusivities/4",
    "/problem/model/diffusivities/5",
];
/// The diffusivity and the source of a diffusion, and the value that edges hold.
pub(super) const DIFFUSIVITY: &str = "/problem/diffusivity";
pub(super) const SOURCE: &str = "/problem/source";
pub(super) const HELD: &str = "/edges/value";

/// A parameter that takes values at points.
struct DataField<'a> {
    pointer: &'static str,
    name: Option<&'a str>,
    source: &'a PointsSource,
}

impl<'a> DataField<'a> {
    fn of(pointer: &'static str, field: &'a OwnField) -> Option<Self> {
        match field {
            OwnField::Formula { .. } => None,
            OwnField::Data { name, source } => Some(Self { pointer, name: name.as_deref(), source }),
        }
    }

    fn of_choice(pointer: &'static str, field: Option<&'a FieldChoice>) -> Option<Self> {
        match field {
            Some(FieldChoice::Own(field)) => Self::of(pointer, field),
            _ => None,
        }
    }

    fn of_initial(initial: Option<&'a InitialChoice>) -> Option<Self> {
        match initial {
            Some(InitialChoice::Field(field)) => Self::of_choice("/problem/initial", Some(field)),
            _ => None,
        }
    }

    fn of_value(pointer: &'static str, value: &'a FieldValue) -> Option<Self> {
        match value {
            FieldValue::Text(_) => None,
            FieldValue::Own(field) => Self::of(pointer, field),
        }
    }

    /// Whether the values are in the file of the surface.
    fn is_of_surface(&self) -> bool {
        self.source.upload.is_none() && self.source.file.is_none()
    }
}

/// All of a scene.
fn data_fields(spec: &SurfacePde) -> Vec<DataField<'_>> {
    let mut found: Vec<Option<DataField<'_>>> = match &spec.problem {
        ProblemSpec::LaplaceBeltrami { field } | ProblemSpec::Gradient { field } => {
            vec![DataField::of_choice("/problem/field", field.as_ref())]
        }
        ProblemSpec::Poisson { field, source, .. } => {
            vec![DataField::of_choice("/problem/field", field.as_ref()), DataField::of_choice(SOURCE, source.as_ref())]
        }
        ProblemSpec::Diffusion { initial, diffusivity, source, .. } => vec![
            DataField::of_initial(initial.as_ref()),
            DataField::of_value(DIFFUSIVITY, diffusivity),
            source.as_ref().and_then(|source| DataField::of_value(SOURCE, source)),
        ],
        ProblemSpec::Advection { initial, .. } | ProblemSpec::MovingDiffusion { initial, .. } => {
            vec![DataField::of_initial(initial.as_ref())]
        }
        ProblemSpec::ReactionDiffusion { model: ModelChoice::Formula { initial, diffusivities, .. }, .. } => {
            let starts = initial.0.iter().zip(STARTS);
            let spreads = diffusivities.0.iter().zip(DIFFUSIVITIES);
            starts.chain(spreads).map(|(value, pointer)| DataField::of_value(pointer, value)).collect()
        }
        // Forcing takes an exact operator, which data do not have.
        ProblemSpec::ReactionDiffusion { .. }
        | ProblemSpec::Curvature
        | ProblemSpec::Eigenvalues { .. }
        | ProblemSpec::GeodesicDistance { .. } => Vec::new(),
    };
    if let EdgesChoice::Dirichlet { value, .. } = &spec.edges {
        found.push(DataField::of_value(HELD, value));
    }
    found.into_iter().flatten().collect()
}

/// The files with values that a scene names.
pub(super) fn references(spec: &SurfacePde, errors: &mut Vec<Violation>) -> Vec<CloudReference> {
    let mut found = Vec::new();
    for field in data_fields(spec) {
        if field.is_of_surface() {
            if !matches!(spec.surface, SurfaceChoice::Points { .. }) {
                let detail = "this surface comes without a file that could have values";
                let allowed = json!({"type": "data", "upload": "upl_…"});
                errors.push(Violation::new(field.pointer, "conflict", detail, json!(field.name), allowed));
            }
        } else {
            found.extend(field.source.reference(field.pointer, CloudRole::Values, errors));
        }
    }
    found
}

/// Violations where there are other numbers of values than of points of the file of the surface.
pub(super) fn check_sizes(clouds: &[CloudReference], sizes: &CloudSizes) -> Vec<Violation> {
    let Some(surface) = sizes.get("/surface") else { return Vec::new() };
    let points = surface.points + surface.left_out;
    let values = clouds.iter().filter(|cloud| cloud.role == CloudRole::Values);
    let found = values.filter_map(|cloud| Some((cloud.pointer, sizes.get(cloud.pointer)?.points)));
    let refuse =
        |(pointer, count): (&str, u64)| Violation::new(pointer, "conflict", told(count, points), count, points);
    found.filter(|(_, count)| *count != points).map(refuse).collect()
}

fn told(values: u64, points: u64) -> String {
    format!("there are {values} values for {points} points")
}

/// The values of all data fields at the unknowns of a run. `surface` has the points of the surface where they came from outside,
/// and `rows` the index of each unknown among them; without a surface from outside, unknowns are in the order of values.
///
/// # Errors
/// A violation for each field: no such values, another number of them than of points, values that are not finite.
pub(super) fn values(
    spec: &SurfacePde,
    clouds: &Clouds,
    surface: Option<&Cloud>,
    rows: &[usize],
) -> Result<BTreeMap<&'static str, Vec<f64>>, Vec<Violation>> {
    let mut errors = Vec::new();
    let mut found = BTreeMap::new();
    for field in data_fields(spec) {
        match of_field(&field, clouds, surface, rows) {
            Ok(values) => {
                found.insert(field.pointer, values);
            }
            Err(detail) => {
                let got = json!({"type": "data", "name": field.name, "upload": field.source.upload.to_json()});
                errors.push(Violation::new(field.pointer, "data", detail, got, Value::Null));
            }
        }
    }
    if errors.is_empty() { Ok(found) } else { Err(errors) }
}

fn of_field(
    field: &DataField<'_>,
    clouds: &Clouds,
    surface: Option<&Cloud>,
    rows: &[usize],
) -> Result<Vec<f64>, String> {
    let own = if field.is_of_surface() { surface } else { None };
    let handed_over = own.or_else(|| clouds.get(field.pointer)).ok_or("the values were not handed over")?;
    let column = handed_over.column(field.name)?;
    let of_file = own.is_none();
    let expected = match surface {
        Some(surface) if of_file => surface.points_in_file(),
        Some(surface) => surface.positions.len(),
        None => rows.len(),
    };
    if column.len() != expected {
        return Err(told(column.len() as u64, expected as u64));
    }
    let place = |row: usize| surface.filter(|_| of_file).map_or(row, |surface| surface.place_in_file(row));
    let at = |row: &usize| {
        let place = place(*row);
        let value = column[place];
        if value.is_finite() { Ok(value) } else { Err(format!("value {place} (counted from 0) is {value}")) }
    };
    rows.iter().map(at).collect()
}
