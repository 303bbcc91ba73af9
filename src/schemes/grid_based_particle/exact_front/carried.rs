//! Exact motion in a flow.

use super::{Comparison, ExactFrontMotion, Moment, POINTS_PER_SPACING, for_each_sample};
use crate::geometry::surfaces::Ball;
use crate::geometry::{Surface, Vector};
use crate::parallel::Interrupted;
use crate::schemes::exact_motion::{ExactFront, ExactMotion};
use rayon::prelude::{IntoParallelRefMutIterator, ParallelIterator};

/// Spacing of samples that a flow is going to carry along, relative to that of other samples: the flow draws them apart.
const CARRIED_SPACING: f64 = 0.5;
/// Least spacing of these samples, relative to the root mean square of the spacings of the foot points. On a refined grid the
/// whole surface would have far more samples than foot points.
const LEAST_SPACING: f64 = 0.4;

impl<const D: usize> ExactFrontMotion<D> for ExactMotion<D> {
    fn ball(&self, start: &Ball<D>, time: f64) -> Option<Ball<D>> {
        let back = self.flow().is_back(time).then_some(start.center);
        let center = self.flow().rigid_path(&start.center, time).or(back)?;
        Some(Ball { center, radius: start.radius })
    }

    fn compare(&self, moment: &Moment<'_, D>) -> Result<Option<Comparison<D>>, Interrupted> {
        let Some(surface) = self.surface() else { return Ok(None) };
        Ok(Some(match self.front(moment.time, moment.spacing(), moment.interrupt)? {
            Some(front) => compare_with_front(&front, surface, moment),
            None => compare_by_backward_map(self, surface, moment),
        }))
    }
}

/// Foot points compared with an exact front that is known as a whole.
fn compare_with_front<const D: usize>(
    front: &ExactFront<'_, D>,
    surface: &dyn Surface<D>,
    moment: &Moment<'_, D>,
) -> Comparison<D> {
    let spacing = moment.spacing();
    let chains = front.chains(spacing / POINTS_PER_SPACING);
    let mut samples = Vec::new();
    if chains.is_empty() {
        for_each_sample(surface, spacing, |x| samples.extend(front.place_by_formula(&x)));
    }
    let distances = moment.for_each(&moment.feet.positions, f64::NAN, |x| front.signed_distance(x));
    Comparison { distances, chains, samples }
}

/// Foot points compared with the surface at the start by the backward map, and samples of the surface carried along.
fn compare_by_backward_map<const D: usize>(
    motion: &ExactMotion<D>,
    surface: &dyn Surface<D>,
    moment: &Moment<'_, D>,
) -> Comparison<D> {
    let (time, interrupt) = (moment.time, moment.interrupt);
    let fine = (CARRIED_SPACING * moment.spacing()).max(least_spacing(moment));
    let mut samples: Vec<Vector<D>> = Vec::new();
    for_each_sample(surface, fine, |x| samples.push(x));
    samples.par_iter_mut().for_each(|x| {
        if !interrupt.is_raised() {
            *x = motion.place_about(x, time);
        }
    });
    let distance = |x: &Vector<D>| motion.distance_nearby(x, time).unwrap_or(f64::NAN);
    let distances = moment.for_each(&moment.feet.positions, f64::NAN, distance);
    Comparison { distances, chains: Vec::new(), samples }
}

/// Least spacing of samples.
fn least_spacing<const D: usize>(moment: &Moment<'_, D>) -> f64 {
    let feet = moment.feet;
    let squares: f64 = feet.nodes.iter().map(|node| moment.grid.spacing_of(*node).powi(2)).sum();
    LEAST_SPACING * (squares / feet.len().max(1) as f64).sqrt()
}
