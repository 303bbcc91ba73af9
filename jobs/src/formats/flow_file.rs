//! Velocities on a regular grid from outside: image data of VTKHDF files, of one time or several, and VTI files.

use super::image::Image;
use super::{file_bytes, vti, vtkhdf_image};
use crate::spec::uploads::FlowContents;
use meniscus::geometry::flows::GridNodes;
use meniscus::scene::{Cloud, Column};
use std::fs::File;

/// Names of the components.
const COMPONENTS: [&str; 3] = ["velocity_x", "velocity_y", "velocity_z"];

/// Reads a flow, and says what was found.
///
/// # Errors
/// A sentence: what is wrong, where, and what helps.
pub fn read(file: &mut File) -> Result<(FlowContents, Cloud), String> {
    let image =
        if file_bytes::is_hdf5(file)? { vtkhdf_image::read(file)? } else { vti::read(&file_bytes::all(file)?)? };
    let dimension = check(&image)?;
    let nodes = &image.nodes;
    let fastest = image.velocity.as_chunks::<3>().0.iter().map(|[x, y, z]| x.hypot(*y).hypot(*z)).fold(0.0, f64::max);
    let contents = FlowContents {
        nodes: nodes.counts,
        low: nodes.origin,
        high: nodes.end(),
        times: nodes.times.len() as u64,
        first_time: nodes.times.first().copied().unwrap_or(0.0),
        last_time: nodes.times.last().copied().unwrap_or(0.0),
        fastest,
    };
    let component = |d: usize| image.velocity.iter().skip(d).step_by(3).copied().collect();
    let columns = (0..dimension).map(|d| Column { name: COMPONENTS[d].to_owned(), values: component(d) }).collect();
    Ok((contents, Cloud { columns, grid: Some(image.nodes), ..Cloud::default() }))
}

/// The dimension of an image.
fn check(image: &Image) -> Result<usize, String> {
    let GridNodes { counts, origin, spacing, times } = &image.nodes;
    let dimension = if counts[2] > 1 { 3 } else { 2 };
    if counts[..dimension].iter().any(|n| *n < 2) {
        let [x, y, z] = counts;
        return Err(format!(
            "the grid has {x} × {y} × {z} nodes; along x and y (and z in space) there must be two or more"
        ));
    }
    let is_length = |d: usize| spacing[d].is_finite() && spacing[d] > 0.0 && origin[d].is_finite();
    if let Some(d) = (0..dimension).find(|d| !is_length(*d)) {
        let axis = ["x", "y", "z"][d];
        return Err(format!(
            "along {axis} the origin is {} and the spacing {}; they must be numbers, the spacing > 0",
            origin[d], spacing[d]
        ));
    }
    if let Some(k) = times.iter().position(|time| !time.is_finite()) {
        return Err(format!("the time of step {k} (counted from 0) is {}", times[k]));
    }
    if let Some(k) = (1..times.len()).find(|k| times[*k - 1] >= times[*k]) {
        return Err(format!("the times do not ascend: {} is followed by {}", times[k - 1], times[k]));
    }
    if times.is_empty() {
        return Err("there are no times of velocities: Steps/Values is empty".to_owned());
    }
    let expected = image.nodes.len() * times.len() * 3;
    if image.velocity.len() != expected {
        return Err(format!("there are {} numbers of velocities for {expected}", image.velocity.len()));
    }
    if let Some(k) = image.velocity.iter().position(|u| !u.is_finite()) {
        let (node, time) = (k / 3 % image.nodes.len(), k / 3 / image.nodes.len());
        return Err(format!(
            "the velocity of node {node} (counted from 0) at time step {time} is {}",
            image.velocity[k]
        ));
    }
    Ok(dimension)
}
