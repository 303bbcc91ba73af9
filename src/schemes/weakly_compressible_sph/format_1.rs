//! The reader for checkpoints of format 1.

use super::guard::Guard;
use super::monitors::{names, names_of_version_0_1, save_row};
use super::summary::{Late, Shape, Summary, ThirdMeans};
use crate::particles::Particles;
use crate::simulation::format_1::{copy, copy_particles, fit_soundness, from_bits, numbers, soundness};
use crate::simulation::section::{check_length, known};
use crate::simulation::{Component, Entry, LoadError, Section};
use crate::time::Clock;

/// The state that the arrays of a checkpoint of format 1 stand for.
///
/// # Errors
/// [`LoadError`].
pub(super) fn translate<const D: usize>(
    arrays: &Section,
    particles: &Particles<D>,
    guard: &Guard<D>,
    (has_interface, has_flow_fits): (bool, bool),
) -> Result<Section, LoadError> {
    let mut state = Section::default();
    copy_particles(arrays, particles, &mut state)?;
    let columns = ["phase", "velocity", "acceleration", "reference", "density", "density_rate"];
    state.extend("particles", |section| copy(arrays, &columns, section))?;
    let [parts_of_step, resting, bounded, absorbed] = numbers("counters", arrays.counts("counters")?)?;
    let [max_cfl, condition, initial_measure] = numbers("monitors", arrays.reals("monitors")?)?;
    let [origin_time, time_step] = numbers("origin", arrays.reals("origin")?)?;
    let [origin_step] = numbers("origin_step", arrays.counts("origin_step")?)?;
    state.put_section("pace", |section| {
        section.put_real("time_step", time_step);
        section.put_component("origin", &Clock { step: origin_step, time: origin_time });
        section.put_count("parts_of_step", parts_of_step);
    });
    let mut droplets = Section::default();
    copy(arrays, &["droplet", "ball_curvatures"], &mut droplets)?;
    droplets.put_optional("initial_measure", known(initial_measure));
    state.put("droplets", Entry::Section(droplets));
    if has_interface {
        let mut interface = Section::default();
        interface.put("redistancing", soundness(arrays.counts("rescues")?, condition)?);
        interface.put_count("bounded_curvatures", bounded);
        copy(arrays, &["candidate"], &mut interface)?;
        interface.put_count("is_begun", 1);
        interface.put_counts("sides", [0, 0]);
        state.put("interface", Entry::Section(interface));
    }
    if has_flow_fits {
        let [least_pivot] = numbers("flow_pivot", arrays.reals("flow_pivot")?)?;
        state.put_component("flow_fits", &fit_soundness(arrays.counts("flow")?, least_pivot)?);
    }
    state.put_section("guard", |section| guard.save(section));
    state.put_section("pressure", |section| {
        section.put_real("calibration", 1.0);
        section.put_real("background", 0.0);
        section.put_reals("last_volume", &[]);
    });
    state.put_count("absorbed_strays", absorbed);
    state.put_real("lost_particles", 0.0);
    state.put_count("waiting_strays", 0);
    state.put_real("max_cfl", max_cfl);
    state.put_count("resting_steps", resting);
    let row = from_bits(arrays.counts("row")?);
    check_length("row", row.len(), names_of_version_0_1(D))?;
    let mut row = row;
    row.resize(names(D).len(), f64::NAN);
    state.put_section("row", |section| save_row::<D>(&row, section));
    let summary = summary(&from_bits(arrays.counts("summary")?))?;
    state.put_section("summary", |section| summary.save(section));
    Ok(state)
}

/// Nineteen numbers, the last two of them the lengths of the lists behind them: times of crossings, and times and values of
/// extremes in turns.
fn summary(values: &[f64]) -> Result<Summary, LoadError> {
    const HEAD: usize = 19;
    check_length("summary", values.len(), values.len().max(HEAD))?;
    let (head, lists) = values.split_at(HEAD);
    let (crossings, extremes) = (head[17] as usize, head[18] as usize);
    check_length("summary", lists.len(), crossings.saturating_add(extremes.saturating_mul(2)))?;
    let shape = |[time, deformation]: [f64; 2]| Shape { time, deformation };
    Ok(Summary {
        late: Late {
            end_time: head[0],
            count: head[1],
            pressure_jump: head[2],
            pressure_eos_jump: head[3],
            pressure_jump_measured: f64::NAN,
            pressure_balanced: f64::NAN,
            curvature: head[4],
        },
        kinetic: ThirdMeans::default(),
        curvature_mean: head[5],
        curvature_std: head[6],
        least_curvature_std: head[7],
        momentum: head[8],
        largest_speed: 0.0,
        droplets: head[9],
        measure: head[10],
        before_last: shape([head[11], head[12]]),
        last: shape([head[13], head[14]]),
        turned_at: head[15],
        largest_since_zero: head[16],
        crossings: lists[..crossings].to_vec(),
        extremes: lists[crossings..].as_chunks::<2>().0.iter().copied().map(shape).collect(),
    })
}
