//! The reader for checkpoints of format 1.

use crate::simulation::format_1::copy;
use crate::simulation::{LoadError, Section};

/// The state that the arrays of a checkpoint of format 1 stand for.
///
/// # Errors
/// [`LoadError`].
pub(super) fn translate(arrays: &Section) -> Result<Section, LoadError> {
    let mut state = Section::default();
    copy(arrays, &["clock", "value"], &mut state)?;
    Ok(state)
}
