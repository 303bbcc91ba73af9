//! The reader for checkpoints of format 1.

use super::errors::{ENTRIES, FrontErrors};
use super::removals::Removals;
use crate::simulation::format_1::{copy, numbers};
use crate::simulation::section::check_length;
use crate::simulation::{Entry, LoadError, Section};

/// The state that the arrays of a checkpoint of format 1 stand for.
///
/// # Errors
/// [`LoadError`].
pub(super) fn translate(arrays: &Section) -> Result<Section, LoadError> {
    let mut state = Section::default();
    copy(arrays, &["clock"], &mut state)?;
    let mut feet = Section::default();
    let columns = ["position", "normal", "curvature", "gauss_curvature", "parameter", "grid_point", "part"];
    copy(arrays, &columns, &mut feet)?;
    state.put("foot_points", Entry::Section(feet));
    let [starved, extrapolated, unresolved, swept, kept, outside] = numbers("removals", arrays.counts("removals")?)?;
    state.put_component("removals", &Removals { starved, extrapolated, unresolved, swept, kept, outside });
    let [max_cfl, vanished] = numbers("monitors", arrays.reals("monitors")?)?;
    let [has_vanished] = numbers("has_vanished", arrays.counts("has_vanished")?)?;
    state.put_real("max_cfl", max_cfl);
    state.put_optional("vanished_at", (has_vanished > 0).then_some(vanished));
    state.put_list("errors", &errors(arrays.reals("errors")?)?);
    Ok(state)
}

/// A time, and for each quantity whether it is known, and its value.
fn errors(values: &[f64]) -> Result<Vec<FrontErrors>, LoadError> {
    const NUMBERS: usize = 1 + 2 * ENTRIES.len();
    let (entries, _) = values.as_chunks::<NUMBERS>();
    check_length("errors", values.len(), NUMBERS * entries.len())?;
    let error = |numbers: &[f64; NUMBERS]| {
        let value = |k: usize| if numbers[2 * k + 1] > 0.5 { numbers[2 * k + 2] } else { f64::NAN };
        FrontErrors { time: numbers[0], values: std::array::from_fn(value) }
    };
    Ok(entries.iter().map(error).collect())
}
