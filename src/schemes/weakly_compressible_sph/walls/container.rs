//! The walls of a scene: which there are, where they stand, and what they ask of the fluids.

use super::obstacle::Obstacle;
use super::wall::{Beside, Wall};
use crate::closest_point::enclosed_moments::Bounds;
use crate::geometry::Vector;

/// A box with walls at some of its sides, and bodies that stand in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Container<const D: usize> {
    low: Vector<D>,
    high: Vector<D>,
    /// The walls at the lower and the upper end of each axis; None along a periodic one.
    sides: [Option<[Wall<D>; 2]>; D],
    obstacles: Vec<Obstacle<D>>,
}

impl<const D: usize> Container<D> {
    /// The box between two corners.
    #[must_use]
    pub fn new(low: Vector<D>, high: Vector<D>, sides: [Option<[Wall<D>; 2]>; D]) -> Self {
        Self { low, high, sides, obstacles: Vec::new() }
    }

    /// The box with bodies in it.
    #[must_use]
    pub fn with_obstacles(mut self, obstacles: Vec<Obstacle<D>>) -> Self {
        self.obstacles = obstacles;
        self
    }

    /// The wall of a number.
    ///
    /// # Panics
    /// Where [`Self::beside`] gave no such number.
    #[must_use]
    pub fn wall(&self, number: usize) -> &Wall<D> {
        if number >= 2 * D {
            return &self.obstacles[number - 2 * D].wall;
        }
        let Some(walls) = &self.sides[number / 2] else { unreachable!("walls stand at the ends of their own axis") };
        &walls[number % 2]
    }

    /// Whether an axis has walls.
    #[must_use]
    pub fn is_bounded(&self, axis: usize) -> bool {
        self.sides[axis].is_some()
    }

    /// The space for the fluids, infinite along periodic axes.
    #[must_use]
    pub fn bounds(&self) -> Bounds<D> {
        let of = |corner: &Vector<D>, none: f64| {
            Vector::<D>::from_fn(|d, _| if self.is_bounded(d) { corner[d] } else { none })
        };
        Bounds { low: of(&self.low, f64::NEG_INFINITY), high: of(&self.high, f64::INFINITY) }
    }

    /// All walls.
    pub fn walls(&self) -> impl Iterator<Item = &Wall<D>> {
        self.sides.iter().flatten().flatten().chain(self.obstacles.iter().map(|obstacle| &obstacle.wall))
    }

    /// Whether bodies stand in the box.
    #[must_use]
    pub fn has_obstacles(&self) -> bool {
        !self.obstacles.is_empty()
    }

    /// A place beside the nearest body; None where there is none. Along periodic axes its nearest image counts.
    #[must_use]
    pub fn beside_obstacle(&self, x: &Vector<D>) -> Option<Beside<D>> {
        self.nearest_obstacle(x, f64::INFINITY)
    }

    fn nearest_obstacle(&self, x: &Vector<D>, within: f64) -> Option<Beside<D>> {
        let (mut nearest, mut within) = (None, within);
        for (k, obstacle) in self.obstacles.iter().enumerate() {
            let middle = obstacle.middle();
            let image = Vector::<D>::from_fn(|d, _| {
                let length = self.high[d] - self.low[d];
                if self.is_bounded(d) { x[d] } else { x[d] - length * ((x[d] - middle[d]) / length).round() }
            });
            if obstacle.least_distance(&image) < within {
                let beside = obstacle.beside(&image, 2 * D + k);
                if beside.distance < within {
                    within = beside.distance;
                    nearest = Some(beside);
                }
            }
        }
        nearest
    }

    /// A place between the walls: beside the nearest of them. None where there is no wall.
    #[must_use]
    pub fn beside(&self, x: &Vector<D>) -> Option<Beside<D>> {
        let mut nearest: Option<Beside<D>> = None;
        for d in (0..D).filter(|d| self.is_bounded(*d)) {
            for (end, distance) in [x[d] - self.low[d], self.high[d] - x[d]].into_iter().enumerate() {
                if nearest.as_ref().is_none_or(|known| distance < known.distance) {
                    let mut normal = Vector::<D>::zeros();
                    normal[d] = if end == 0 { -1.0 } else { 1.0 };
                    nearest = Some(Beside { distance, normal, wall: 2 * d + end });
                }
            }
        }
        let within = nearest.as_ref().map_or(f64::INFINITY, |known| known.distance);
        self.nearest_obstacle(x, within).or(nearest)
    }

    /// The nearest place of the fluids' space, for a place behind a wall.
    #[must_use]
    pub fn foot(&self, x: &Vector<D>) -> Vector<D> {
        if let Some(beside) = self.beside(x).filter(|beside| beside.wall >= 2 * D) {
            return x + beside.normal * beside.distance;
        }
        let Bounds { low, high } = self.bounds();
        Vector::<D>::from_fn(|d, _| x[d].clamp(low[d], high[d]))
    }
}

#[cfg(test)]
mod tests {
    use super::{Container, Vector, Wall};
    use crate::schemes::weakly_compressible_sph::walls::ContactAngle;

    #[test]
    fn places_lie_beside_the_nearest_wall() {
        let wall = |velocity: f64| Wall {
            velocity: Vector::<2>::new(velocity, 0.0),
            holds_fluid: true,
            contact: ContactAngle::of(1.0),
        };
        let sides = [None, Some([wall(0.0), wall(2.0)])];
        let container = Container::new(Vector::<2>::new(0.0, -1.0), Vector::<2>::new(4.0, 1.0), sides);
        let beside = container.beside(&Vector::<2>::new(0.1, 0.7)).unwrap();
        assert!((beside.distance - 0.3).abs() < 1e-15);
        assert_eq!((beside.normal[1], container.wall(beside.wall).velocity[0]), (1.0, 2.0));
        let behind = Vector::<2>::new(-9.0, -1.25);
        assert_eq!(container.beside(&behind).unwrap().distance, -0.25);
        assert_eq!(container.foot(&behind), Vector::<2>::new(-9.0, -1.0));
    }
}
