//! Small conveniences over libhdf5: checksummed data sets of plain numbers, without times.

use crate::spec::forecast::CHUNK_ROWS;
use hdf5::{Dataset, Group, H5Type};

/// Writes numbers as a data set with a Fletcher-32 checksum per chunk; `components` > 1 makes it two-dimensional.
///
/// # Errors
/// Errors of libhdf5.
pub fn write<T: H5Type>(group: &Group, name: &str, components: usize, values: &[T]) -> hdf5::Result<Dataset> {
    let rows = values.len() / components.max(1);
    let builder = group.new_dataset::<T>();
    let dataset = match (values.is_empty(), components) {
        // Checksums need chunks, and chunks need numbers.
        (true, 1) => builder.shape(0).create(name)?,
        (true, _) => builder.shape([0, components]).create(name)?,
        (false, 1) => builder.fletcher32().chunk(rows.min(CHUNK_ROWS)).shape(rows).create(name)?,
        (false, _) => {
            builder.fletcher32().chunk((rows.min(CHUNK_ROWS), components)).shape([rows, components]).create(name)?
        }
    };
    if !values.is_empty() {
        dataset.write_raw(values)?;
    }
    Ok(dataset)
}

/// Writes a number as a data set of one element, in one piece, or none as a data set without elements.
///
/// # Errors
/// Whatever libhdf5 reports.
pub fn write_number<T: H5Type>(group: &Group, name: &str, value: Option<T>) -> hdf5::Result<()> {
    let dataset = group.new_dataset::<T>().shape(usize::from(value.is_some())).create(name)?;
    value.map_or(Ok(()), |value| dataset.write_raw(&[value]))
}

/// The bytes of numbers as they stand in the file, for digests (this program runs on little-endian machines only).
#[must_use]
pub fn real_bytes(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// The same for whole numbers.
#[must_use]
pub fn count_bytes(values: &[u64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}
