//! Exact motion in a flow.

use super::{Comparison, ExactFrontMotion, Moment, POINTS_PER_SPACING, for_each_sample};
use crate::geometry::surfaces::Ball;
use crate::geometry::{Surface, Vector};
use crate::parallel::Interrupted;
use crate::schemes::exact_motion::{ExactFront, ExactMotion};

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
            Some(front) => compare_with_front(&front, surface, moment)?,
            None => compare_by_backward_map(self, surface, moment)?,
        }))
    }
}

/// Foot points compared with an exact front that is known as a whole.
fn compare_with_front<const D: usize>(
    front: &ExactFront<'_, D>,
    surface: &dyn Surface<D>,
    moment: &Moment<'_, D>,
) -> Result<Comparison<D>, Interrupted> {
    let spacing = moment.spacing();
    let chains = front.chains(spacing / POINTS_PER_SPACING);
    let mut samples = Vec::new();
    if chains.is_empty() {
        for_each_sample(surface, spacing, |x| samples.extend(front.place_by_formula(&x)));
    }
    let distances = front.signed_distances(&moment.feet.positions, moment.interrupt)?;
    Ok(Comparison { distances, chains, samples })
}

/// Foot points compared with the surface at the start by the backward map, and samples of the surface carried along.
fn compare_by_backward_map<const D: usize>(
    motion: &ExactMotion<D>,
    surface: &dyn Surface<D>,
    moment: &Moment<'_, D>,
) -> Result<Comparison<D>, Interrupted> {
    let (time, interrupt) = (moment.time, moment.interrupt);
    let fine = (CARRIED_SPACING * moment.spacing()).max(least_spacing(moment));
    let mut samples: Vec<Vector<D>> = Vec::new();
    for_each_sample(surface, fine, |x| samples.push(x));
    motion.carry_about(&mut samples, time, interrupt);
    let nearby = motion.distances_nearby(&moment.feet.positions, time, interrupt)?;
    let distances = nearby.unwrap_or_else(|| vec![f64::NAN; moment.feet.len()]);
    Ok(Comparison { distances, chains: Vec::new(), samples })
}

/// Least spacing of samples.
fn least_spacing<const D: usize>(moment: &Moment<'_, D>) -> f64 {
    let feet = moment.feet;
    let squares: f64 = feet.nodes.iter().map(|node| moment.grid.spacing_of(*node).powi(2)).sum();
    LEAST_SPACING * (squares / feet.len().max(1) as f64).sqrt()
}
