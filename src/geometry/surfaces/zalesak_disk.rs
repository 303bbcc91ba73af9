//! Zalesak's disk: a disk with a slot that is cut in from below (2D only; Zalesak 1979).

use super::profile::{Piece, nearest_of};
use super::{Surface, SurfacePoint, Vector, arc_points, join, line_points};
use crate::geometry::level::{BallLevel, LevelFunction, PlaneLevel};
use std::f64::consts::PI;
use std::sync::Arc;

/// A disk without a vertical slot that extends by `slot_depth` up from the lowest point of the circle.
#[derive(Debug, Clone, PartialEq)]
pub struct ZalesakDisk {
    center: Vector<2>,
    radius: f64,
    half_width: f64,
    top: f64,
    /// Half the angle (rad) that the slot takes from the circle.
    opening: f64,
    pieces: Vec<Piece>,
}

impl ZalesakDisk {
    /// A slotted disk. The slot must be narrower than the disk and end inside it.
    #[must_use]
    pub fn new(center: Vector<2>, radius: f64, slot_width: f64, slot_depth: f64) -> Self {
        let half_width = 0.5 * slot_width;
        let opening = (half_width / radius).asin();
        let top = slot_depth - radius;
        let mouth = -(radius * radius - half_width * half_width).sqrt();
        let at = |x: f64, y: f64| center + Vector::<2>::new(x, y);
        let pieces = vec![
            Piece::Arc { center, radius, middle: 0.5 * PI, half_width: PI - opening },
            // Normals point into the slot, which is outside the shape.
            Piece::Line { from: at(-half_width, mouth), to: at(-half_width, top), normal: Vector::<2>::new(1.0, 0.0) },
            Piece::Line { from: at(-half_width, top), to: at(half_width, top), normal: Vector::<2>::new(0.0, -1.0) },
            Piece::Line { from: at(half_width, top), to: at(half_width, mouth), normal: Vector::<2>::new(-1.0, 0.0) },
        ];
        Self { center, radius, half_width, top, opening, pieces }
    }

    fn is_inside(&self, x: &Vector<2>) -> bool {
        let local = x - self.center;
        let in_slot = local[0].abs() < self.half_width && local[1] < self.top;
        local.norm() < self.radius && !in_slot
    }
}

impl Surface<2> for ZalesakDisk {
    fn nearest(&self, x: &Vector<2>) -> SurfacePoint<2> {
        let (foot, _) = nearest_of(&self.pieces, x);
        SurfacePoint {
            distance: if self.is_inside(x) { -foot.distance } else { foot.distance },
            point: foot.point,
            normal: foot.normal,
            curvature: foot.normal.map(|_| foot.curvature),
        }
    }

    fn bounding_box(&self) -> (Vector<2>, Vector<2>) {
        (self.center.add_scalar(-self.radius), self.center.add_scalar(self.radius))
    }

    fn area_or_volume(&self) -> f64 {
        // Disk minus the slot's rectangle above the mouth minus the circular segment below it.
        let mouth = -(self.radius.powi(2) - self.half_width.powi(2)).sqrt();
        let segment = self.radius.powi(2) * (self.opening - self.opening.sin() * self.opening.cos());
        PI * self.radius.powi(2) - 2.0 * self.half_width * (self.top - mouth) - segment
    }

    fn near_medial_axis(&self, x: &Vector<2>, tolerance: f64) -> bool {
        let (foot, second) = nearest_of(&self.pieces, x);
        second - foot.distance <= tolerance
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<2>>> {
        let start = -0.5 * PI + self.opening;
        let arc = arc_points(&self.center, [self.radius; 2], start, start + 2.0 * (PI - self.opening), spacing);
        let at = |x: f64, y: f64| self.center + Vector::<2>::new(x, y);
        let (left, right) = (at(-self.half_width, self.top), at(self.half_width, self.top));
        let sides = vec![
            line_points(&arc[arc.len() - 1], &left, spacing),
            line_points(&left, &right, spacing),
            line_points(&right, &arc[0], spacing),
        ];
        vec![join(std::iter::once(arc).chain(sides).collect())]
    }

    fn faces(&self) -> Option<Vec<Arc<dyn LevelFunction<2>>>> {
        let level = |piece: &Piece| -> Arc<dyn LevelFunction<2>> {
            match *piece {
                Piece::Arc { center, radius, .. } => Arc::new(BallLevel { center, radius }),
                Piece::Line { from, normal, .. } => Arc::new(PlaneLevel::through(&from, normal)),
            }
        };
        Some(self.pieces.iter().map(level).collect())
    }
}
