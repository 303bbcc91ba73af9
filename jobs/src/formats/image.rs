//! Velocities at the nodes of an image, and what images of every format have in common.

use super::cloud_file::MOST_VALUES;
use meniscus::geometry::flows::GridNodes;

/// Name of the velocities in a file.
pub(super) const VELOCITY: &str = "velocity";
/// Times between which a flow is known at most.
const MOST_TIMES: u64 = 100_000;

/// An image: its nodes, and the velocities at them, three numbers a node, time after time.
pub(super) struct Image {
    pub nodes: GridNodes,
    pub velocity: Vec<f64>,
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
    values.as_chunks::<2>().0.iter().flat_map(|[x, y]| [*x, *y, 0.0]).collect()
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
