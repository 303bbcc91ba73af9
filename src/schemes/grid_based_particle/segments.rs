//! How segments of a front are told apart (GBPM 3.3.2): by normals, by their closed part of the front at the start, and
//! by a parameter along that part.

use super::foot_points::FootPoints;
use crate::geometry::{Domain, Surface, Vector};
use crate::neighbors::{CellList, NeighborSearch};

/// What particles of one segment have in common beside their normals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segments {
    /// Whether they have the same closed part of the front at the start.
    pub by_part: bool,
    /// Largest difference of their parameters along that part, from 0 to 1 around it. None where parameters are not used.
    pub parameter: Option<f64>,
}

impl Segments {
    /// Whether two particles may belong to one segment as far as labels tell.
    pub(super) fn match_labels<const D: usize>(&self, feet: &FootPoints<D>, i: usize, j: usize) -> bool {
        let is_same_part = !self.by_part || feet.parts[i] == feet.parts[j];
        let apart = |most: f64| shorter_difference(feet.parameters[i] - feet.parameters[j]).abs() > most;
        is_same_part && !self.parameter.is_some_and(apart)
    }
}

/// A difference of parameters by the shorter way around.
pub(super) fn shorter_difference(difference: f64) -> f64 {
    difference - difference.round()
}

/// The outlines of a closed part, with the position of each point along them.
pub(super) struct Course<const D: usize> {
    points: Vec<Vector<D>>,
    /// Length before each point, relative to the whole length.
    shares: Vec<f64>,
    /// Whether point k and k + 1 are joined.
    joined: Vec<bool>,
    cells: CellList<D>,
}

impl<const D: usize> Course<D> {
    /// The outlines of a surface in the plane, with points about `spacing` apart; None in space.
    pub fn from_surface(surface: &dyn Surface<D>, spacing: f64) -> Option<Self> {
        let chains = surface.outline(spacing);
        let (mut points, mut shares, mut joined) = (Vec::new(), Vec::new(), Vec::new());
        let mut length = 0.0;
        for chain in &chains {
            for (k, x) in chain.iter().enumerate() {
                length += if k > 0 { (x - chain[k - 1]).norm() } else { 0.0 };
                points.push(*x);
                shares.push(length);
                joined.push(k + 1 < chain.len());
            }
        }
        if length.is_nan() || length <= 0.0 {
            return None;
        }
        shares.iter_mut().for_each(|share| *share /= length);
        let mut cells = CellList::new(Domain::unbounded());
        cells.rebuild(points.iter().copied(), spacing);
        Some(Self { points, shares, joined, cells })
    }

    /// The parameter of the nearest place on the chords that end at the nearest point.
    pub fn parameter(&self, x: &Vector<D>) -> f64 {
        let Some((nearest, _)) = self.cells.nearest(x, f64::INFINITY) else { return 0.0 };
        let along = |k: usize| {
            let chord = self.points[k + 1] - self.points[k];
            (k, (x - self.points[k]).dot(&chord) / chord.norm_squared())
        };
        let after = self.joined[nearest].then(|| along(nearest)).filter(|(_, s)| *s >= 0.0);
        let before = || (nearest > 0 && self.joined[nearest - 1]).then(|| along(nearest - 1));
        let Some((k, s)) = after.or_else(before) else { return self.shares[nearest] };
        (self.shares[k] + s.clamp(0.0, 1.0) * (self.shares[k + 1] - self.shares[k])).rem_euclid(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::{Course, shorter_difference};
    use crate::geometry::Vector;
    use crate::geometry::surfaces::Ball;

    #[test]
    fn a_parameter_is_the_share_of_the_way_round() {
        let ball = Ball { center: Vector::<2>::new(0.2, -0.1), radius: 0.5 };
        let course = Course::from_surface(&ball, 0.01).unwrap();
        let at = |angle: f64| course.parameter(&(ball.center + Vector::<2>::new(angle.cos(), angle.sin()) * 0.51));
        let start = at(0.0);
        for k in 1..50 {
            let angle = f64::from(k) * 0.12;
            let share = angle / std::f64::consts::TAU;
            let way = shorter_difference(at(angle) - start);
            assert!(
                shorter_difference(way - share).abs() < 1e-4 || shorter_difference(way + share).abs() < 1e-4,
                "{angle}: {way}"
            );
        }
    }

    #[test]
    fn differences_go_the_shorter_way() {
        assert!((shorter_difference(0.95 - 0.05) + 0.1).abs() < 1e-15);
        assert!((shorter_difference(0.3) - 0.3).abs() < 1e-15);
    }
}
