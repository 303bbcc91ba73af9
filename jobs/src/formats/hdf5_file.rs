//! Small conveniences over libhdf5: checksummed data sets of plain numbers, without times.

use crate::spec::forecast::CHUNK_ROWS;
use hdf5::{Dataset, File, FileBuilder, Group, H5Type};
use std::path::Path;

/// Creates a file without locking it. A file is written by one process under a name that no other uses, and renamed when it is
/// whole: a lock protects nothing, and on file systems without locks (NFS, Lustre) creating the file would fail.
/// `HDF5_USE_FILE_LOCKING` still overrules this.
///
/// # Errors
/// Errors of libhdf5.
pub fn create(path: &Path) -> hdf5::Result<File> {
    FileBuilder::new().with_fapl(|plist| plist.file_locking(false)).create(path)
}

/// Opens a file to read it, without locking it.
///
/// # Errors
/// Errors of libhdf5.
pub fn open(path: &Path) -> hdf5::Result<File> {
    FileBuilder::new().with_fapl(|plist| plist.file_locking(false)).open(path)
}

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

#[cfg(test)]
mod tests {
    use super::{create, open};
    use rustix::fs::{FlockOperation, flock};

    #[test]
    fn a_lock_of_another_process_does_not_matter() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("x.h5");
        create(&path).unwrap().close().unwrap();
        let held = std::fs::File::open(&path).unwrap();
        flock(&held, FlockOperation::NonBlockingLockExclusive).unwrap();
        assert!(open(&path).is_ok());
        assert!(create(&path).is_ok());
        // What libhdf5 does by itself.
        assert!(std::env::var_os("HDF5_USE_FILE_LOCKING").is_some() || hdf5::File::open(&path).is_err());
    }
}
