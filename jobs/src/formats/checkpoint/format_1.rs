//! Format 1: a state as flat arrays under `/state`, told apart by name, and the clock in the meta text alone. What the arrays
//! stand for, each scheme of the engine knows.

use super::{CheckpointError, Contents, Meta};
use meniscus::simulation::{Entry, Section};
use serde::{Deserialize, Serialize};

/// One array of the state.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
pub struct ArrayMeta {
    /// Name.
    pub name: String,
    /// Numbers an item; 0 marks whole numbers.
    pub components: usize,
    /// Digest of its bytes.
    pub sha256: String,
}

/// Reads the arrays into one section, with the clock beside them.
///
/// # Errors
/// [`CheckpointError`].
pub(super) fn read(contents: &Contents, meta: &Meta) -> Result<Section, CheckpointError> {
    let mut arrays = Section::default();
    arrays.put_section("clock", |clock| {
        clock.put_count("step", meta.step);
        clock.put_real("time", meta.time);
    });
    for ArrayMeta { name, components, sha256 } in &meta.arrays {
        if name == "clock" || name.contains('/') {
            return Err(CheckpointError::Damaged { what: name.clone() });
        }
        let bytes = contents.verified(name, sha256)?;
        let words = bytes.as_chunks::<8>().0.iter();
        let entry = if *components == 0 {
            Entry::Counts(words.map(|word| u64::from_le_bytes(*word)).collect())
        } else {
            let values = words.map(|word| f64::from_le_bytes(*word)).collect();
            Entry::Reals { components: *components, values }
        };
        arrays.put(name, entry);
    }
    Ok(arrays)
}
