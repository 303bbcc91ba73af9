//! Where a moving front is exactly. One file a motion.

mod carried;
mod offset;
mod rays;
mod shrinking;

pub use offset::OffsetFront;
pub use shrinking::ShrinkingBall;

use super::foot_points::FootPoints;
use super::grid::Grid;
use super::tube::{GridLevel, for_each_near};
use crate::geometry::surfaces::Ball;
use crate::geometry::{Surface, Vector};
use crate::parallel::{Interrupt, Interrupted};
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};

/// The exact motion of a front. The defaults are those of a motion that is not known.
pub trait ExactFrontMotion<const D: usize>: Send + Sync {
    /// The exact front at a time, where it is a ball then and at the start.
    fn ball(&self, _start: &Ball<D>, _time: f64) -> Option<Ball<D>> {
        None
    }

    /// The time at which the front vanishes, where that is known. `start` is the front at the start, where it is a ball.
    fn extinction(&self, _start: Option<&Ball<D>>) -> Option<f64> {
        None
    }

    /// Dimension of the front.
    fn front_dimension(&self) -> i32 {
        D as i32 - 1
    }

    /// Foot points compared with the exact front; None where that is not known.
    ///
    /// # Errors
    /// [`Interrupted`] when the run is asked to stop.
    fn compare(&self, _moment: &Moment<'_, D>) -> Result<Option<Comparison<D>>, Interrupted> {
        Ok(None)
    }
}

/// A motion that is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnknownMotion;

impl<const D: usize> ExactFrontMotion<D> for UnknownMotion {}

/// The foot points at one time.
pub struct Moment<'a, const D: usize> {
    /// The foot points.
    pub feet: &'a FootPoints<D>,
    /// Their grid.
    pub grid: &'a Grid,
    /// Time.
    pub time: f64,
    /// Asks a running step to be dropped.
    pub interrupt: &'a Interrupt,
}

impl<const D: usize> Moment<'_, D> {
    /// The spacing of the finest level with foot points.
    pub(super) fn spacing(&self) -> f64 {
        self.feet.finest_spacing(self.grid)
    }

    /// A number for each place, in parallel; of no use after an interrupt.
    pub(super) fn for_each<T: Copy + Send + Sync>(
        &self,
        places: &[Vector<D>],
        nothing: T,
        find: impl Fn(&Vector<D>) -> T + Sync,
    ) -> Vec<T> {
        places.par_iter().map(|x| if self.interrupt.is_raised() { nothing } else { find(x) }).collect()
    }
}

/// Foot points compared with the exact front.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Comparison<const D: usize> {
    /// Signed distance of each foot point from the exact front.
    pub distances: Vec<f64>,
    /// The exact front in the plane, as chains of joined points.
    pub chains: Vec<Vec<Vector<D>>>,
    /// Samples of the exact front that are not joined.
    pub samples: Vec<Vector<D>>,
}

/// Points per spacing on the chains of an exact front.
pub(super) const POINTS_PER_SPACING: f64 = 20.0;
/// Spacing of the lattice from which samples of an exact surface come, relative to the spacing of the front. It differs from
/// the lattice of the foot points, which would find these again.
const SAMPLE_SPACING: f64 = 0.53;

/// Foot points compared with a ball.
pub(super) fn compare_with_ball<const D: usize>(ball: &Ball<D>, moment: &Moment<'_, D>) -> Comparison<D> {
    let spacing = moment.spacing();
    let chains = ball.outline(spacing / POINTS_PER_SPACING);
    let mut samples = Vec::new();
    if chains.is_empty() {
        for_each_sample(ball, spacing, |x| samples.push(x));
    }
    let distances = moment.feet.positions.iter().map(|x| (x - ball.center).norm() - ball.radius).collect();
    Comparison { distances, chains, samples }
}

/// Calls `visit` with points of a surface about half a spacing apart.
fn for_each_sample<const D: usize>(surface: &dyn Surface<D>, spacing: f64, mut visit: impl FnMut(Vector<D>)) {
    let fine = GridLevel::with_spacing(SAMPLE_SPACING * spacing);
    let reach = 0.5 * fine.spacing() * (D as f64).sqrt();
    for_each_near(surface, reach, fine, |_, x| visit(surface.nearest(&x).point));
}
