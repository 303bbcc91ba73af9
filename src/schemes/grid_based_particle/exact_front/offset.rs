//! Exact motion with a constant speed along the normal.

use super::{Comparison, ExactFrontMotion, Moment, SAMPLE_SPACING};
use crate::geometry::surfaces::Ball;
use crate::geometry::{Surface, Vector};
use crate::parallel::Interrupted;
use crate::schemes::grid_based_particle::topology::Topology;
use crate::schemes::grid_based_particle::tube::{GridLevel, for_each_near};

/// A front whose distance from the start is speed × time: the union of all parts where they merge, each part alone where
/// they cross.
pub struct OffsetFront<const D: usize> {
    /// Closed parts of the front at the start.
    pub surfaces: Vec<Box<dyn Surface<D>>>,
    /// Speed along the outward normal.
    pub speed: f64,
    /// What happens where parts meet.
    pub topology: Topology,
}

/// Largest distance from the exact front of a point that counts as on it.
const ON_FRONT: f64 = 1e-9;

impl<const D: usize> OffsetFront<D> {
    /// The distance of a place from the front that has moved by some displacement; its sign is that of the start's level.
    fn distance(&self, x: &Vector<D>, displacement: f64) -> f64 {
        let levels = self.surfaces.iter().map(|surface| surface.signed_distance(x) - displacement);
        match self.topology {
            // Outside, the distance of a union is the least of those of its parts.
            Topology::Merge => levels.fold(f64::INFINITY, f64::min),
            Topology::Cross => {
                levels.fold(f64::INFINITY, |best, level| if level.abs() < best.abs() { level } else { best })
            }
        }
    }

    /// Points of that front: points of a lattice near it, moved along the ray from the start that passes through them.
    fn samples(&self, spacing: f64, displacement: f64) -> Vec<Vector<D>> {
        let mut points = Vec::new();
        let fine = GridLevel::with_spacing(SAMPLE_SPACING * spacing);
        for surface in &self.surfaces {
            for_each_near(surface.as_ref(), displacement.abs() + fine.spacing(), fine, |_, x| {
                let exact = surface.nearest(&x);
                if (exact.distance - displacement).abs() > fine.spacing() || exact.distance == 0.0 {
                    return;
                }
                let point = exact.point + (x - exact.point) * (displacement / exact.distance);
                if self.distance(&point, displacement).abs() < ON_FRONT {
                    points.push(point);
                }
            });
        }
        points
    }
}

impl<const D: usize> ExactFrontMotion<D> for OffsetFront<D> {
    fn ball(&self, start: &Ball<D>, time: f64) -> Option<Ball<D>> {
        let radius = start.radius + self.speed * time;
        (radius > 0.0).then_some(Ball { center: start.center, radius })
    }

    fn extinction(&self, start: Option<&Ball<D>>) -> Option<f64> {
        start.filter(|_| self.speed < 0.0).map(|ball| ball.radius / -self.speed)
    }

    fn compare(&self, moment: &Moment<'_, D>) -> Result<Option<Comparison<D>>, Interrupted> {
        let displacement = self.speed * moment.time;
        let samples = self.samples(moment.spacing(), displacement);
        let distances = moment.feet.positions.iter().map(|x| self.distance(x, displacement)).collect();
        Ok(Some(Comparison { distances, chains: Vec::new(), samples }))
    }
}

#[cfg(test)]
mod tests {
    use super::{Ball, ExactFrontMotion, OffsetFront, Surface, Topology, Vector};

    fn two_circles(topology: Topology) -> OffsetFront<2> {
        let circle =
            |x: f64| -> Box<dyn Surface<2>> { Box::new(Ball { center: Vector::<2>::new(x, 0.0), radius: 0.2 }) };
        OffsetFront { surfaces: vec![circle(-0.3), circle(0.3)], speed: 1.0, topology }
    }

    #[test]
    fn merged_parts_have_no_front_inside_their_union() {
        let (middle, moved) = (Vector::<2>::new(0.05, 0.0), 0.15);
        assert!((two_circles(Topology::Merge).distance(&middle, moved) - (0.25 - 0.2 - moved)).abs() < 1e-15);
        let on_both = Vector::<2>::new(0.05, 0.0);
        assert!(two_circles(Topology::Cross).distance(&on_both, moved).abs() < 1e-15);
        for x in two_circles(Topology::Merge).samples(0.02, moved) {
            assert!(two_circles(Topology::Merge).distance(&x, moved).abs() < 1e-9);
        }
    }

    #[test]
    fn a_ball_that_shrinks_vanishes() {
        let ball = Ball { center: Vector::<2>::zeros(), radius: 0.2 };
        let front = OffsetFront::<2> { surfaces: Vec::new(), speed: -0.5, topology: Topology::Merge };
        assert!((front.extinction(Some(&ball)).unwrap() - 0.4).abs() < 1e-15);
        assert!((front.ball(&ball, 0.2).unwrap().radius - 0.1).abs() < 1e-15 && front.ball(&ball, 0.41).is_none());
        assert!(two_circles(Topology::Merge).extinction(Some(&ball)).is_none());
    }
}
