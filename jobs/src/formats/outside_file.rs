//! Any file from outside that hands over points, values or velocities, by its purpose. The service's inspection and `meniscus run`
//! read files by this alone, so that both accept and refuse the same, in the same words.

use super::{flow_file, points_file, values_file};
use crate::spec::uploads::{Contents, Purpose};
use meniscus::scene::Cloud;
use std::fs::File;

/// Reads a file for a purpose, which is not that of a checkpoint, and says what was found.
///
/// # Errors
/// A sentence: what is wrong, where, and what helps.
pub fn read(file: &mut File, purpose: Purpose) -> Result<(Contents, Cloud), String> {
    match purpose {
        Purpose::Values => values_file::read(file).map(|(found, cloud)| (Contents::Values(found), cloud)),
        Purpose::Flow => flow_file::read(file).map(|(found, cloud)| (Contents::Flow(found), cloud)),
        _ => points_file::read(file, purpose).map(|(found, cloud)| (Contents::Points(found), cloud)),
    }
}
