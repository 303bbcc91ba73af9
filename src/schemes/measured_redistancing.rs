//! The two halves of a redistancing with their phases booked: what every closest-point scheme does, each with points
//! and answers of its own.

use crate::closest_point::{ClosestPoints, LevelSurface};
use crate::geometry::Vector;
use crate::parallel::{Interrupt, Interrupted};
use crate::simulation::Phases;

/// Rebuilds the surface from the level of points.
///
/// # Errors
/// [`Interrupted`] when the run is asked to stop.
pub fn rebuild<const D: usize>(
    surface: &mut LevelSurface<D>,
    positions: &[Vector<D>],
    level: &[f64],
    normals: Option<&[Vector<D>]>,
    interrupt: &Interrupt,
    phases: &mut Phases,
) -> Result<(), Interrupted> {
    phases.measure("redistancing/detection", || surface.detect(positions, level, interrupt))?;
    phases.measure("redistancing/regression", || surface.fit_samples(positions, level, normals, interrupt))
}

/// Asks the surface about every point with a point of the surface within `reach`.
///
/// # Errors
/// [`Interrupted`] when the run is asked to stop.
pub fn query<const D: usize>(
    surface: &LevelSurface<D>,
    points: &[Vector<D>],
    reach: f64,
    answers: &mut ClosestPoints<D>,
    interrupt: &Interrupt,
    phases: &mut Phases,
) -> Result<(), Interrupted> {
    phases.measure("redistancing/query", || surface.closest_points(points, reach, answers, interrupt))
}
