//! What the bytes of a file from outside are: HDF5, or others that are read whole.

use super::structure;
use std::fs::File;
use std::io::{Read, Seek};

/// Bytes at most of a file that is read whole.
const LARGEST: u64 = 1 << 30;

/// Whether a file begins as one of HDF5.
pub(super) fn is_hdf5(file: &mut File) -> Result<bool, String> {
    let mut head = Vec::new();
    let read = file.take(structure::SIGNATURE.len() as u64).read_to_end(&mut head);
    read.and_then(|_| file.rewind()).map_err(|error| error.to_string())?;
    Ok(head == structure::SIGNATURE)
}

/// The bytes of a file.
pub(super) fn all(file: &mut File) -> Result<Vec<u8>, String> {
    let size = file.metadata().map_err(|error| error.to_string())?.len();
    if size > LARGEST {
        return Err(format!("a file of {size} bytes; at most {LARGEST} are read"));
    }
    let mut bytes = Vec::new();
    file.take(LARGEST).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes)
}
