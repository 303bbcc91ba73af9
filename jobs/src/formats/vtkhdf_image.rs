//! Image data of VTKHDF files: velocities at the nodes of a regular grid, at one time or at those of `Steps`.

use super::image::{Image, VELOCITY, check_count, check_direction, counts, triples};
use super::structure::{self, DataSet, Structure};
use meniscus::geometry::flows::GridNodes;
use std::fs::File;

/// The group of all.
const GROUP: &str = "/VTKHDF";

/// Reads the velocities of a file.
///
/// # Errors
/// A sentence that names the data set or attribute and what is wrong with it.
pub(super) fn read(file: &File) -> Result<Image, String> {
    let structure = structure::read(file).map_err(|refusal| refusal.to_string())?;
    let attribute = |name: &str| structure.attributes.get(&format!("{GROUP}@{name}")).map(Vec::as_slice);
    let triple = |name: &str| -> Result<[f64; 3], String> {
        let found = attribute(name).and_then(|values| <[f64; 3]>::try_from(values).ok());
        found.ok_or_else(|| format!("the group {GROUP} has no attribute {name} of three numbers: a flow is ImageData"))
    };
    let extent = attribute("WholeExtent")
        .ok_or_else(|| format!("the group {GROUP} has no attribute WholeExtent of six numbers: a flow is ImageData"))?;
    let counts = counts(extent)?;
    check_direction(attribute("Direction"))?;
    let (origin, spacing) = (triple("Origin")?, triple("Spacing")?);
    // An extent may begin beside the origin.
    let origin = std::array::from_fn(|d| origin[d] + extent[2 * d] * spacing[d]);
    let place = format!("{GROUP}/PointData/{VELOCITY}");
    let missing = || format!("there is no data set {place}: vectors at the nodes (cell data are not read)");
    let data_set = structure.data_sets.get(&place).ok_or_else(missing)?;
    let times = reals(file, &structure, &format!("{GROUP}/Steps/Values"))?.unwrap_or_else(|| vec![0.0]);
    check_count(counts, times.len() as u64)?;
    let (components, stored) = components(&place, data_set, counts)?;
    let values = structure::reals(file, &place, data_set).map_err(|refusal| refusal.to_string())?;
    let values = triples(values, components);
    let offsets = reals(file, &structure, &format!("{GROUP}/Steps/PointDataOffsets/{VELOCITY}"))?;
    let velocity = in_order(&values, (times.len(), stored), offsets.as_deref())?;
    Ok(Image { nodes: GridNodes { counts, origin, spacing, times }, velocity })
}

fn reals(file: &File, structure: &Structure, place: &str) -> Result<Option<Vec<f64>>, String> {
    let Some(data_set) = structure.data_sets.get(place) else { return Ok(None) };
    structure::reals(file, place, data_set).map(Some).map_err(|refusal| refusal.to_string())
}

/// Components of a vector, and the number of times that a data set has.
fn components(place: &str, data_set: &DataSet, counts: [usize; 3]) -> Result<(usize, usize), String> {
    let nodes = counts.iter().product::<usize>() as u64;
    let found = &data_set.extent;
    let components = found.last().copied().filter(|n| matches!(n, 2 | 3)).filter(|_| data_set.is_number());
    let whole = components.filter(|components| data_set.elements().is_multiple_of(nodes * components));
    match whole {
        Some(components) => Ok((components as usize, (data_set.elements() / (nodes * components)) as usize)),
        None => {
            let [x, y, z] = counts;
            Err(format!(
                "{place} has the extent {found:?}; expected are [{z}, {y}, {x}, 3], with the number of times before it"
            ))
        }
    }
}

/// The velocities of the times in order; `offsets` tell where each is stored.
fn in_order(values: &[f64], (times, stored): (usize, usize), offsets: Option<&[f64]>) -> Result<Vec<f64>, String> {
    let size = values.len() / stored.max(1);
    let mut all = Vec::with_capacity(times * size);
    for time in 0..times {
        let offset = match offsets {
            Some(offsets) => offsets.get(time).copied().unwrap_or(-1.0),
            None => time as f64,
        };
        if !(0.0..stored as f64).contains(&offset) {
            return Err(format!(
                "there are {stored} times of velocities, and time step {time} is that of place {offset}"
            ));
        }
        all.extend_from_slice(&values[offset as usize * size..(offset as usize + 1) * size]);
    }
    Ok(all)
}
