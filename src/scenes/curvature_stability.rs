//! What reconstructions and steps motion by mean curvature bears, measured on circles and spheres of 20 to 100 spacings over hundreds of
//! steps (docs/results/front-notes.md): a little beyond it blows up slowly, much at once.

use crate::time::PathIntegrator;

/// How much of a step of four stages two bear, as the real parts of their regions of stability: 2/2.785.
const OF_TWO_STAGES: f64 = 0.718;
/// The longest step that four stages bear with weights, dt/h², and up to which weights a curve bears what it does without.
const WEIGHTED: f64 = 0.5;
const UNWEIGHTED: f64 = 0.3;

/// The fewest particles of a reconstruction. The paper's ten of a surface are too few.
#[must_use]
pub fn fewest_particles(dimension: usize, degree: usize) -> usize {
    match (dimension, degree) {
        (2, 2) => 6,
        (2, 3) => 7,
        (2, _) => 10,
        (_, 2) => 14,
        (_, 3) => 16,
        _ => 32,
    }
}

/// The largest weight: with more, few particles count.
#[must_use]
pub fn most_weight(dimension: usize) -> f64 {
    if dimension == 2 { 1.0 } else { 0.5 }
}

/// The longest step, dt/h². Wide reconstructions of a surface bear less, and so do weights; two stages bear less than four.
#[must_use]
pub fn longest_step(integrator: PathIntegrator, dimension: usize, degree: usize, weight: f64) -> f64 {
    let (unweighted, borne) = match (dimension, degree) {
        (2, _) => (0.8, UNWEIGHTED),
        (_, 2) => (0.7, 0.0),
        (_, 3) => (0.65, 0.0),
        _ => (0.55, 0.0),
    };
    let of_four = if weight > borne { WEIGHTED } else { unweighted };
    if matches!(integrator, PathIntegrator::TvdRk2) { of_four * OF_TWO_STAGES } else { of_four }
}
