//! Runge–Kutta stages of a motion whose velocity depends on the geometry of the front: each stage has normals and curvatures of
//! reconstructions through the particles of the stage.

use super::{MotionStep, MovingFront};
use crate::geometry::Vector;
use crate::schemes::grid_based_particle::foot_points::FootPoints;
use crate::time::PathIntegrator;
use crate::time::integrators::PathError;

/// Stages of the classical Runge–Kutta scheme: offset of the stage from the start and its weight, both in steps.
const FOUR_STAGES: [(f64, f64); 4] = [(0.0, 1.0 / 6.0), (0.5, 1.0 / 3.0), (0.5, 1.0 / 3.0), (1.0, 1.0 / 6.0)];
/// The same of the TVD scheme of order 2.
const TWO_STAGES: [(f64, f64); 2] = [(0.0, 0.5), (1.0, 0.5)];

/// Moves all particles through one step; returns the longest displacement in spacings. `set` writes the velocities of all
/// particles at a time.
///
/// # Errors
/// Those of `set`, and a raised interrupt.
pub(super) fn advance<const D: usize>(
    front: &mut MovingFront<'_, D>,
    step: &MotionStep<'_>,
    mut set: impl FnMut(&FootPoints<D>, f64, &mut [Vector<D>]) -> Result<(), PathError>,
) -> Result<f64, PathError> {
    let stages: &[(f64, f64)] = match step.integrator {
        PathIntegrator::TvdRk2 => &TWO_STAGES,
        PathIntegrator::Rk4 | PathIntegrator::Dopri5 { .. } => &FOUR_STAGES,
    };
    let MovingFront { feet, stages: storage, renew_geometry } = front;
    let (starts, slopes, velocities) = (&mut storage.starts, &mut storage.slopes, &mut storage.velocities);
    starts.clear();
    starts.extend_from_slice(&feet.positions);
    slopes.clear();
    slopes.resize(feet.len(), Vector::<D>::zeros());
    velocities.clear();
    velocities.resize(feet.len(), Vector::<D>::zeros());
    for (k, (offset, weight)) in stages.iter().enumerate() {
        if k > 0 {
            for ((x, start), velocity) in feet.positions.iter_mut().zip(&*starts).zip(&*velocities) {
                *x = start + velocity * (offset * step.step);
            }
            renew_geometry(feet)?;
        }
        set(feet, step.time + offset * step.step, velocities)?;
        for (slope, velocity) in slopes.iter_mut().zip(&*velocities) {
            *slope += velocity * *weight;
        }
    }
    let mut longest = 0.0_f64;
    for ((x, start), slope) in feet.positions.iter_mut().zip(&*starts).zip(&*slopes) {
        *x = start + slope * step.step;
        longest = longest.max(slope.norm());
    }
    Ok(longest * step.step / step.spacing)
}
