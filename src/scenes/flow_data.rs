//! Flows that come from data: what a scene names, and what is handed over when it is built.

use crate::geometry::flows::{FlowChoice, GridData};
use crate::geometry::{Flow, Vector};
use crate::scene::cloud::{CloudReference, CloudRole, Clouds, PointsSource};
use crate::spec::Violation;
use serde_json::Value;

/// The file that a flow at a pointer comes from, if it comes from one.
#[must_use]
pub fn reference(flow: &FlowChoice, pointer: &'static str, errors: &mut Vec<Violation>) -> Option<CloudReference> {
    let FlowChoice::Grid { upload, file, .. } = flow else { return None };
    let source = PointsSource { upload: upload.clone(), file: file.clone() };
    source.reference(pointer, CloudRole::Flow, errors)
}

/// The velocities that were handed over for the flow at a pointer.
#[must_use]
pub fn data<'a>(clouds: &'a Clouds, pointer: &str) -> Option<GridData<'a>> {
    let cloud = clouds.get(pointer)?;
    let nodes = cloud.grid.as_ref()?;
    let component = |d: usize| cloud.columns.get(d).map_or(&[][..], |column| column.values.as_slice());
    Some(GridData { nodes, components: std::array::from_fn(component) })
}

/// A violation where points of a run begin where a flow from data has no velocity.
#[must_use]
pub fn check_places<const D: usize>(flow: &dyn Flow<D>, points: &[Vector<D>], pointer: &str) -> Option<Violation> {
    let fault = points.iter().find_map(|x| flow.fault(x, 0.0))?;
    Some(Violation::new(pointer, "data", fault, Value::Null, "a grid that reaches around all particles"))
}
