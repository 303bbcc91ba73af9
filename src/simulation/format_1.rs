//! What the readers of checkpoints of format 1 share. Such a checkpoint holds flat arrays, some of them of unlike numbers
//! that are told apart by their place. Each scheme turns its own arrays into sections in its `format_1.rs`.

use super::section::{Entry, LoadError, Section, check_length};
use crate::operators::SupportDiagnostics;
use crate::particles::{ColumnValues, Particles};

/// Counters of fits and queries in the order of format 1, under their present names.
const RESCUES: [&str; 10] = [
    "fits.solved",
    "fits.larger_radius",
    "fits.lower_degree",
    "fits.orthogonal",
    "fits.none",
    "samples.not_projected",
    "newton.solves",
    "newton.iterations",
    "queries.other_sample",
    "queries.sample_distance",
];

/// Copies arrays that keep their names.
///
/// # Errors
/// [`LoadError`] where one is missing.
pub fn copy(arrays: &Section, names: &[&str], state: &mut Section) -> Result<(), LoadError> {
    for name in names {
        state.put(name, arrays.entry(name)?.clone());
    }
    Ok(())
}

/// The clock, and a section of the particles' positions and columns.
///
/// # Errors
/// [`LoadError`].
pub fn copy_particles<const D: usize>(
    arrays: &Section,
    particles: &Particles<D>,
    state: &mut Section,
) -> Result<(), LoadError> {
    copy(arrays, &["clock"], state)?;
    let mut section = Section::default();
    copy(arrays, &["position"], &mut section)?;
    for column in particles.columns() {
        copy(arrays, &[column.name], &mut section)?;
        if let (ColumnValues::Scalar(_) | ColumnValues::Vector(_), Entry::Counts(_)) =
            (&column.values, arrays.entry(column.name)?)
        {
            return Err(LoadError::Kind { name: column.name.to_owned(), expected: "an array of numbers" });
        }
    }
    state.put("particles", Entry::Section(section));
    Ok(())
}

/// The soundness of fits and queries.
///
/// # Errors
/// [`LoadError`].
pub fn soundness(rescues: &[u64], worst_condition: f64) -> Result<Entry, LoadError> {
    check_length("rescues", rescues.len(), RESCUES.len())?;
    let mut section = Section::default();
    for (name, count) in RESCUES.iter().zip(rescues) {
        section.put_count(name, *count);
    }
    section.put_real("worst_condition", worst_condition);
    Ok(Entry::Section(section))
}

/// The soundness of fits of operators.
///
/// # Errors
/// [`LoadError`].
pub fn fit_soundness(counts: &[u64], min_pivot: f64) -> Result<SupportDiagnostics, LoadError> {
    let [enlarged, low_rank, unresolved, failed] = numbers("soundness", counts)?;
    Ok(SupportDiagnostics { enlarged, low_rank, unresolved, failed, first_failed: None, min_pivot })
}

/// The numbers of an array of known length.
///
/// # Errors
/// [`LoadError::Length`].
pub fn numbers<T: Copy, const N: usize>(name: &str, values: &[T]) -> Result<[T; N], LoadError> {
    values.try_into().map_err(|_| LoadError::Length { name: name.to_owned(), got: values.len(), expected: N })
}

/// Bits that stood for numbers, NaN among them.
#[must_use]
pub fn from_bits(bits: &[u64]) -> Vec<f64> {
    bits.iter().map(|bits| f64::from_bits(*bits)).collect()
}
