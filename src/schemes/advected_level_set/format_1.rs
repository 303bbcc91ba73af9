//! The reader for checkpoints of format 1.

use super::errors::{DistanceErrors, MeasuredErrors};
use crate::particles::Particles;
use crate::simulation::format_1::{copy_particles, numbers, soundness};
use crate::simulation::section::check_length;
use crate::simulation::{LoadError, Section};

/// The state that the arrays of a checkpoint of format 1 stand for.
///
/// # Errors
/// [`LoadError`].
pub(super) fn translate<const D: usize>(arrays: &Section, particles: &Particles<D>) -> Result<Section, LoadError> {
    let mut state = Section::default();
    copy_particles(arrays, particles, &mut state)?;
    let [measure, max_cfl, condition] = numbers("monitors", arrays.reals("monitors")?)?;
    state.put("redistancing", soundness(arrays.counts("rescues")?, condition)?);
    let [redistanced, measured] = numbers("redistanced", arrays.counts("redistanced")?)?;
    // The largest number stood for a level that was never redistanced.
    state.put_optional_count("redistanced_at_step", Some(redistanced).filter(|step| *step != u64::MAX));
    state.put_section("enclosed_measure", |section| {
        section.put_real("value", measure);
        section.put_count("at_step", measured);
    });
    state.put_real("max_cfl", max_cfl);
    state.put_list("errors", &errors(arrays.reals("errors")?)?);
    Ok(state)
}

/// Time, error of the measure, whether distances were known, and four errors of them.
fn errors(values: &[f64]) -> Result<Vec<MeasuredErrors>, LoadError> {
    let (entries, _) = values.as_chunks::<7>();
    check_length("errors", values.len(), 7 * entries.len())?;
    let error = |&[time, measure_relative, is_known, phi_rms, phi_max, samples_mean, samples_max]: &[f64; 7]| {
        let distances = DistanceErrors { phi_rms, phi_max, samples_mean, samples_max };
        MeasuredErrors { time, measure_relative, distances: (is_known > 0.5).then_some(distances) }
    };
    Ok(entries.iter().map(error).collect())
}
