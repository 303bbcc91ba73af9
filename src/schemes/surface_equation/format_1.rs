//! The reader for checkpoints of format 1: what the problems and the simulation held.

use crate::simulation::format_1::{copy, fit_soundness, numbers};
use crate::simulation::{Entry, LoadError, Section};

/// The state of a simulation around the section of its problem.
///
/// # Errors
/// [`LoadError`].
pub(super) fn translate(arrays: &Section, problem: Section) -> Result<Section, LoadError> {
    let mut state = Section::default();
    copy(arrays, &["clock"], &mut state)?;
    let [least_pivot] = numbers("least_pivot", arrays.reals("least_pivot")?)?;
    let [coarse] = numbers("coarse", arrays.counts("coarse")?)?;
    state.put_component("fits", &fit_soundness(arrays.counts("soundness")?, least_pivot)?);
    state.put_count("coarse_points", coarse);
    state.put("problem", Entry::Section(problem));
    Ok(state)
}

pub(super) fn pointwise(arrays: &Section) -> Result<Section, LoadError> {
    let mut section = Section::default();
    copy(arrays, &["value"], &mut section)?;
    Ok(section)
}

pub(super) fn curvature(arrays: &Section) -> Result<Section, LoadError> {
    let mut section = Section::default();
    copy(arrays, &["mean_curvature", "gauss_curvature"], &mut section)?;
    Ok(section)
}

pub(super) fn poisson(arrays: &Section) -> Result<Section, LoadError> {
    let mut section = pointwise(arrays)?;
    let [iterations] = numbers("iterations", arrays.counts("iterations")?)?;
    let [residual] = numbers("residual", arrays.reals("residual")?)?;
    section.put_count("iterations", iterations);
    section.put_real("residual", residual);
    // It was not kept.
    section.put_real("residual_floor", 0.0);
    Ok(section)
}

pub(super) fn evolution(arrays: &Section) -> Result<Section, LoadError> {
    let mut section = pointwise(arrays)?;
    copy(arrays, &["previous", "peaks"], &mut section)?;
    let [attempts, iterations] = numbers("work", arrays.counts("work")?)?;
    let [inner_step] = numbers("inner_step", arrays.reals("inner_step")?)?;
    let [rate] = numbers("rate", arrays.reals("rate")?)?;
    section.put_count("attempts", attempts);
    section.put_count("iterations", iterations);
    section.put_real("inner_step", inner_step);
    section.put_real("rate", rate);
    Ok(section)
}
