//! Velocities on a regular grid from outside: image data of VTKHDF files, of one time or several, and VTI files.

use super::cloud_file::MOST_VALUES;
use super::{structure, vti, vtkhdf_image};
use crate::spec::uploads::FlowContents;
use meniscus::geometry::flows::GridNodes;
use meniscus::scene::{Cloud, Column};
use std::fs::File;
use std::io::{Read, Seek};

/// Bytes of a VTI file at most.
const LARGEST: u64 = 2 << 30;
/// Name of the velocities in a file, and of its components.
pub(super) const VELOCITY: &str = "velocity";
const COMPONENTS: [&str; 3] = ["velocity_x", "velocity_y", "velocity_z"];
/// Times between which a flow is known at most.
pub(super) const MOST_TIMES: u64 = 100_000;

/// An image: its nodes, and the velocities at them, three numbers a node, time after time.
pub(super) struct Image {
    pub nodes: GridNodes,
    pub velocity: Vec<f64>,
}

/// Reads a flow, and says what was found.
///
/// # Errors
/// A sentence: what is wrong, where, and what helps.
pub fn read(file: &mut File) -> Result<(FlowContents, Cloud), String> {
    let failed = |error: std::io::Error| error.to_string();
    let mut head = Vec::new();
    (&mut *file).take(structure::SIGNATURE.len() as u64).read_to_end(&mut head).map_err(failed)?;
    file.rewind().map_err(failed)?;
    let image = if head == structure::SIGNATURE {
        vtkhdf_image::read(file)?
    } else {
        let size = file.metadata().map_err(failed)?.len();
        if size > LARGEST {
            return Err(format!("a file of {size} bytes; at most {LARGEST} are read"));
        }
        let mut bytes = Vec::new();
        file.take(LARGEST).read_to_end(&mut bytes).map_err(failed)?;
        vti::read(&bytes)?
    };
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
    if let Some(k) = (1..times.len()).find(|k| times[*k - 1] >= times[*k]) {
        return Err(format!("the times do not ascend: {} is followed by {}", times[k - 1], times[k]));
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

/// Refuses more numbers than are read.
pub(super) fn check_count(nodes: [usize; 3], times: u64) -> Result<(), String> {
    let nodes = nodes.iter().fold(1_u64, |product, n| product.saturating_mul(*n as u64));
    let numbers = nodes.saturating_mul(times).saturating_mul(3);
    if numbers > MOST_VALUES || times > MOST_TIMES {
        return Err(format!("{nodes} nodes at {times} times are {numbers} numbers; at most {MOST_VALUES} are read"));
    }
    Ok(())
}

/// Triples of velocities from vectors of two or three components.
pub(super) fn triples(values: Vec<f64>, components: usize) -> Vec<f64> {
    if components == 3 {
        return values;
    }
    values.chunks(components).flat_map(|u| [u[0], u[1], 0.0]).collect()
}

/// Nodes along the axes of an extent of indices from first to last.
pub(super) fn counts(extent: &[f64]) -> Result<[usize; 3], String> {
    let wrong = || format!("the extent {extent:?} is not from first to last index along x, y and z");
    let mut counts = [0; 3];
    let [x0, x1, y0, y1, z0, z1] = *extent else { return Err(wrong()) };
    for (count, (first, last)) in counts.iter_mut().zip([(x0, x1), (y0, y1), (z0, z1)]) {
        let found = last - first + 1.0;
        if !(1.0..=1e9).contains(&found) {
            return Err(wrong());
        }
        *count = found as usize;
    }
    Ok(counts)
}

/// Refuses images that are turned.
pub(super) fn check_direction(direction: Option<&[f64]>) -> Result<(), String> {
    const STRAIGHT: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    match direction {
        Some(found) if found != STRAIGHT => {
            Err(format!("the image is turned (its Direction is {found:?}); resample it to axes along x, y and z"))
        }
        _ => Ok(()),
    }
}
