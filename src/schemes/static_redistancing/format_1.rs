//! The reader for checkpoints of format 1.

use crate::particles::Particles;
use crate::simulation::format_1::{copy, copy_particles, soundness};
use crate::simulation::{LoadError, Section};

/// The state that the arrays of a checkpoint of format 1 stand for.
///
/// # Errors
/// [`LoadError`].
pub(super) fn translate<const D: usize>(
    arrays: &Section,
    particles: &Particles<D>,
    has_grid: bool,
) -> Result<Section, LoadError> {
    let mut state = Section::default();
    copy_particles(arrays, particles, &mut state)?;
    let condition = arrays.reals_of("worst_condition", 1)?[0];
    state.put("redistancing", soundness(arrays.counts("rescues")?, condition)?);
    if has_grid {
        copy(arrays, &["remeshed_level"], &mut state)?;
    }
    Ok(state)
}
