//! A whole redistancing with its phases booked: what every closest-point scheme does, each with its own bookkeeping
//! of the answers.

use crate::closest_point::{Answers, LevelSurface};
use crate::geometry::Vector;
use crate::parallel::{Interrupt, Interrupted};
use crate::simulation::Phases;

/// Rebuilds the surface from the level of the particles, then asks it about every particle whose nearest sample lies
/// within `reach`.
///
/// # Errors
/// [`Interrupted`] when somebody asked to stop.
#[expect(clippy::too_many_arguments, reason = "inputs, output and bookkeeping, each named")]
pub fn redistance<const D: usize>(
    surface: &mut LevelSurface<D>,
    positions: &[Vector<D>],
    level: &[f64],
    normals: Option<&[Vector<D>]>,
    reach: f64,
    answers: &mut Answers<D>,
    interrupt: &Interrupt,
    phases: &mut Phases,
) -> Result<(), Interrupted> {
    rebuild(surface, positions, level, normals, interrupt, phases)?;
    query(surface, positions, reach, answers, interrupt, phases)
}

/// Rebuilds the surface from the level of points.
///
/// # Errors
/// [`Interrupted`] when somebody asked to stop.
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
/// [`Interrupted`] when somebody asked to stop.
pub fn query<const D: usize>(
    surface: &LevelSurface<D>,
    points: &[Vector<D>],
    reach: f64,
    answers: &mut Answers<D>,
    interrupt: &Interrupt,
    phases: &mut Phases,
) -> Result<(), Interrupted> {
    phases.measure("redistancing/query", || surface.closest_points(points, reach, answers, interrupt))
}
