//! A body that stands in the fluids.

use super::wall::{Beside, Wall};
use crate::geometry::{Surface, Vector};
use std::fmt::{Debug, Formatter};
use std::sync::Arc;

/// A body that stands in the fluids, at rest.
#[derive(Clone)]
pub struct Obstacle<const D: usize> {
    surface: Arc<dyn Surface<D>>,
    /// Its surface as a wall.
    pub wall: Wall<D>,
    /// Corners of a box around it.
    low: Vector<D>,
    high: Vector<D>,
}

impl<const D: usize> Obstacle<D> {
    /// The body within a surface.
    #[must_use]
    pub fn new(surface: Arc<dyn Surface<D>>, wall: Wall<D>) -> Self {
        let (low, high) = surface.bounding_box();
        Self { surface, wall, low, high }
    }

    /// The middle of the box around it.
    #[must_use]
    pub fn middle(&self) -> Vector<D> {
        (self.low + self.high) * 0.5
    }

    /// A distance that the body is not nearer than.
    #[must_use]
    pub fn least_distance(&self, x: &Vector<D>) -> f64 {
        (self.low - x).sup(&(x - self.high)).sup(&Vector::<D>::zeros()).norm()
    }

    /// A place beside the body; `wall` is its number.
    #[must_use]
    pub fn beside(&self, x: &Vector<D>, wall: usize) -> Beside<D> {
        let nearest = self.surface.nearest(x);
        let way = (nearest.point - x) * nearest.distance.signum();
        // On the surface itself the way has no direction.
        let own = nearest.normal.map_or_else(Vector::<D>::zeros, |normal| -normal);
        let normal = way.try_normalize(f64::EPSILON * (1.0 + x.norm())).unwrap_or(own);
        Beside { distance: nearest.distance, normal, wall }
    }
}

impl<const D: usize> PartialEq for Obstacle<D> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.surface, &other.surface) && self.wall == other.wall
    }
}

impl<const D: usize> Debug for Obstacle<D> {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Obstacle").field("low", &self.low).field("high", &self.high).finish_non_exhaustive()
    }
}
