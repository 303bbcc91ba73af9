//! Errors of a front: how far the foot points are from the exact front, and the exact front from them.
//!
//! Distances of foot points alone flatter a front with holes. So coverage (the largest distance from the exact front to a foot
//! point) and the largest gap along the front stand beside every error. Means of distances are over the front, not over its
//! foot points, which are crowded where a grid is refined.

use super::coverage::largest_gap;
use super::exact_front::{Comparison, ExactFrontMotion, Moment, compare_with_ball};
use crate::geometry::surfaces::Ball;
use crate::geometry::{Domain, Vector};
use crate::neighbors::{CellList, NeighborSearch};
use crate::parallel::Interrupted;
use crate::schemes::measured_errors::{ErrorNorms, entry};
use crate::simulation::section::known;
use crate::simulation::{Component, ErrorEntry, LoadError, Section};

/// Errors of a front at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrontErrors {
    pub time: f64,
    /// In the order of [`ENTRIES`]; not finite where nothing is known.
    pub values: [f64; ENTRIES.len()],
}

/// Quantities and norms. The L2 norm of the distance is that of GBPM eq. 18, over the angle.
pub(super) const ENTRIES: [(&str, &str); 10] = [
    ("front", "mean"),
    ("front", "rms"),
    ("front", "max"),
    ("front", "l2"),
    ("front", "coverage_h"),
    ("front", "gap_h"),
    ("radius", "mean"),
    ("radius", "deviation"),
    ("curvature", "rms"),
    ("front", "count"),
];

impl Component for FrontErrors {
    fn save(&self, section: &mut Section) {
        section.put_real("time", self.time);
        for ((quantity, norm), value) in ENTRIES.iter().zip(self.values) {
            section.put_optional(&format!("{quantity}.{norm}"), known(value));
        }
    }

    fn load(section: &Section) -> Result<Self, LoadError> {
        let mut values = [f64::NAN; ENTRIES.len()];
        for ((quantity, norm), value) in ENTRIES.iter().zip(&mut values) {
            *value = section.optional(&format!("{quantity}.{norm}"))?.unwrap_or(f64::NAN);
        }
        Ok(Self { time: section.real("time")?, values })
    }
}

impl FrontErrors {
    pub fn entries(&self) -> Vec<ErrorEntry> {
        let known = ENTRIES.iter().zip(self.values).filter(|(_, value)| value.is_finite());
        known.map(|((quantity, norm), value)| entry(quantity, norm, value, self.time, "exact motion")).collect()
    }
}

/// The errors at one moment, where the exact front is known. `ball` is the front at the start, where it is a ball.
///
/// # Errors
/// [`Interrupted`] when the run is asked to stop.
pub(super) fn front_errors<const D: usize>(
    exact: &dyn ExactFrontMotion<D>,
    ball: Option<&Ball<D>>,
    moment: &Moment<'_, D>,
) -> Result<Option<FrontErrors>, Interrupted> {
    let ball = ball.and_then(|ball| exact.ball(ball, moment.time));
    let comparison = match &ball {
        Some(ball) => Some(compare_with_ball(ball, moment)),
        None => exact.compare(moment)?,
    };
    let Some(comparison) = comparison else { return Ok(None) };
    moment.interrupt.check()?;
    let Comparison { distances, chains, .. } = &comparison;
    let coverage = coverage(&comparison, moment);
    moment.interrupt.check()?;
    let Moment { feet, grid, time, .. } = *moment;
    let mut values = [f64::NAN; ENTRIES.len()];
    values[9] = feet.len() as f64;
    if feet.is_empty() {
        // Norms of nothing are no norms: the missing front is the error.
        return Ok(Some(FrontErrors { time, values }));
    }
    let spacings = feet.nodes.iter().map(|node| grid.spacing_of(*node));
    let (finest, dimension) = (moment.spacing(), exact.front_dimension());
    let norms = along_front(distances, spacings.clone().map(|own| (own / finest).powi(dimension)));
    values[..3].copy_from_slice(&norms);
    values[4] = coverage;
    values[5] = if chains.is_empty() { f64::NAN } else { largest_gap(chains, &feet.positions, spacings) };
    if let Some(ball) = &ball {
        values[6..9].copy_from_slice(&errors_of_ball(ball, distances, &feet.curvatures));
        if D == 2 {
            values[3] = over_angle(ball, &feet.positions, distances);
        }
    }
    Ok(Some(FrontErrors { time, values }))
}

/// The largest distance from the exact front to the nearest foot point, in spacings of its level.
fn coverage<const D: usize>(comparison: &Comparison<D>, moment: &Moment<'_, D>) -> f64 {
    let feet = moment.feet;
    let mut cells = CellList::new(Domain::unbounded());
    cells.rebuild(feet.positions.iter().copied(), moment.spacing());
    let in_spacings = |(i, r): (usize, f64)| r / moment.grid.spacing_of(feet.nodes[i]);
    let nearest = |x: &Vector<D>| cells.nearest(x, f64::INFINITY).map_or(f64::INFINITY, in_spacings);
    let largest = |points: &[Vector<D>]| moment.for_each(points, 0.0, nearest).into_iter().fold(f64::NAN, f64::max);
    comparison.chains.iter().map(|chain| largest(chain)).fold(largest(&comparison.samples), f64::max)
}

/// Mean radius, standard deviation of the radius, and root mean square error of the curvature of foot points on a ball.
fn errors_of_ball<const D: usize>(ball: &Ball<D>, distances: &[f64], curvatures: &[f64]) -> [f64; 3] {
    let count = distances.len() as f64;
    let mean = distances.iter().sum::<f64>() / count;
    let square = distances.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>() / count;
    let curvature = (D as f64 - 1.0) / ball.radius;
    let mut norms = ErrorNorms::default();
    curvatures.iter().for_each(|found| norms.add(found - curvature));
    [ball.radius + mean, square.sqrt(), norms.rms()]
}

/// Mean, root mean square and maximum over the front, of which every foot point stands for as much as a cell of its level covers.
fn along_front(distances: &[f64], shares: impl Iterator<Item = f64>) -> [f64; 3] {
    let (mut all, mut sum, mut squares, mut norms) = (0.0, 0.0, 0.0, ErrorNorms::default());
    for (distance, share) in distances.iter().zip(shares) {
        all += share;
        sum += share * distance.abs();
        squares += share * distance * distance;
        norms.add(*distance);
    }
    [sum / all, (squares / all).sqrt(), norms.max()]
}

/// [∫ d² dθ]^½ by the trapezoidal rule over the angles of the foot points (GBPM eq. 18).
fn over_angle<const D: usize>(ball: &Ball<D>, positions: &[Vector<D>], distances: &[f64]) -> f64 {
    let angle = |x: &Vector<D>| (x[1] - ball.center[1]).atan2(x[0] - ball.center[0]);
    let mut sorted: Vec<(f64, f64)> = positions.iter().map(angle).zip(distances.iter().copied()).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let turn = std::f64::consts::TAU;
    let next = sorted.iter().cycle().skip(1);
    let sum: f64 =
        sorted.iter().zip(next).map(|(a, b)| 0.5 * (a.1 * a.1 + b.1 * b.1) * (b.0 - a.0).rem_euclid(turn)).sum();
    sum.sqrt()
}

#[cfg(test)]
mod tests {
    use super::{along_front, over_angle};
    use crate::geometry::Vector;
    use crate::geometry::surfaces::Ball;

    #[test]
    fn a_coarse_foot_point_stands_for_more_of_the_front() {
        let [mean, rms, largest] = along_front(&[0.5, -0.1], [1.0, 4.0].into_iter());
        assert!((mean - 0.18).abs() < 1e-15 && (rms - 0.058_f64.sqrt()).abs() < 1e-15);
        assert!((largest - 0.5).abs() < 1e-15);
    }

    fn ball() -> Ball<2> {
        Ball { center: Vector::<2>::new(0.3, 0.1), radius: 0.5 }
    }

    fn at(angle: f64) -> Vector<2> {
        Vector::<2>::new(0.3 + 0.5 * angle.cos(), 0.1 + 0.5 * angle.sin())
    }

    #[test]
    fn a_constant_error_is_weighed_by_the_whole_turn() {
        let places: Vec<Vector<2>> = [0.1, 0.5, 2.0, 3.0, 5.0].map(at).to_vec();
        let norm = over_angle(&ball(), &places, &[0.2; 5]);
        assert!((norm - 0.2 * std::f64::consts::TAU.sqrt()).abs() < 1e-12);
    }
}
