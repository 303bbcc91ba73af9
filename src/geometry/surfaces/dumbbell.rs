//! Dumbbell: two balls joined by a straight neck along x.
//!
//! The shape is a body of revolution about the x axis (mirror-symmetric in 2D). The closest point therefore lies in the
//! half-plane through the axis and the query point. There the boundary consists of two arcs and a line.

use super::profile::{Piece, nearest_of};
use super::{Surface, SurfacePoint, Vector, arc_points, join, line_points};
use crate::geometry::level::{BallLevel, LevelFunction, TubeLevel};
use std::f64::consts::PI;
use std::sync::Arc;

/// Two balls of equal radius whose centers are `separation` apart, and a cylinder (strip in 2D) between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Dumbbell<const D: usize> {
    center: Vector<D>,
    half_separation: f64,
    radius: f64,
    neck_radius: f64,
    pieces: Vec<Piece>,
}

impl<const D: usize> Dumbbell<D> {
    /// A dumbbell with the given distance between the centers of its balls.
    ///
    /// The neck must be thinner than the balls, and the balls must not touch.
    #[must_use]
    pub fn new(center: Vector<D>, separation: f64, radius: f64, neck_radius: f64) -> Self {
        let half_separation = 0.5 * separation;
        let opening = (neck_radius / radius).asin();
        let joint = half_separation - (radius * radius - neck_radius * neck_radius).sqrt();
        let at = Vector::<2>::new;
        let pieces = vec![
            Piece::Arc { center: at(half_separation, 0.0), radius, middle: 0.0, half_width: PI - opening },
            Piece::Arc { center: at(-half_separation, 0.0), radius, middle: PI, half_width: PI - opening },
            Piece::Line { from: at(-joint, neck_radius), to: at(joint, neck_radius), normal: at(0.0, 1.0) },
        ];
        Self { center, half_separation, radius, neck_radius, pieces }
    }

    /// Half the angle (rad) under which the neck is seen from the center of a ball.
    fn opening(&self) -> f64 {
        (self.neck_radius / self.radius).asin()
    }

    /// Axial coordinate and distance from the axis, and the unit vector that points away from the axis.
    fn half_plane(&self, x: &Vector<D>) -> (Vector<2>, Vector<D>) {
        let mut radial = x - self.center;
        let axial = radial[0];
        radial[0] = 0.0;
        let rho = radial.norm();
        let mut outward = Vector::<D>::zeros();
        outward[1] = 1.0;
        if rho > 0.0 {
            outward = radial / rho;
        }
        (Vector::<2>::new(axial, rho), outward)
    }
}

impl<const D: usize> Surface<D> for Dumbbell<D> {
    fn nearest(&self, x: &Vector<D>) -> SurfacePoint<D> {
        let (plane, outward) = self.half_plane(x);
        let (foot, _) = nearest_of(&self.pieces, &plane);
        let lift = |v: &Vector<2>| {
            let mut y = outward * v[1];
            y[0] = v[0];
            y
        };
        let in_balls = (plane[0].abs() - self.half_separation).hypot(plane[1]) < self.radius;
        let in_neck = plane[0].abs() < self.half_separation && plane[1] < self.neck_radius;
        let curvature =
            if foot.curvature > 0.0 { (D as f64 - 1.0) / self.radius } else { (D as f64 - 2.0) / self.neck_radius };
        SurfacePoint {
            distance: if in_balls || in_neck { -foot.distance } else { foot.distance },
            point: self.center + lift(&foot.point),
            normal: foot.normal.map(|n| lift(&n)),
            curvature: foot.normal.map(|_| curvature),
        }
    }

    fn bounding_box(&self) -> (Vector<D>, Vector<D>) {
        let mut half = Vector::<D>::repeat(self.radius);
        half[0] += self.half_separation;
        (self.center - half, self.center + half)
    }

    fn area_or_volume(&self) -> f64 {
        let (r, a) = (self.radius, self.neck_radius);
        let depth = (r * r - a * a).sqrt();
        let neck = 2.0 * (self.half_separation - depth);
        if D == 2 {
            let cap = r * r * self.opening() - a * depth;
            2.0 * (PI * r * r - cap) + 2.0 * a * neck
        } else {
            let height = r - depth;
            let cap = PI * height * height * (3.0 * r - height) / 3.0;
            2.0 * (4.0 / 3.0 * PI * r * r * r - cap) + PI * a * a * neck
        }
    }

    fn near_medial_axis(&self, x: &Vector<D>, tolerance: f64) -> bool {
        let (plane, _) = self.half_plane(x);
        let (foot, second) = nearest_of(&self.pieces, &plane);
        second - foot.distance <= tolerance || plane[1] <= tolerance && self.nearest(x).distance < 0.0
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<D>>> {
        if D != 2 {
            return Vec::new();
        }
        let ball = |side: f64| {
            let mut c = self.center;
            c[0] += side * self.half_separation;
            c
        };
        let sweep = PI - self.opening();
        let right = arc_points(&ball(1.0), [self.radius; 2], -sweep, sweep, spacing);
        let left = arc_points(&ball(-1.0), [self.radius; 2], PI - sweep, PI + sweep, spacing);
        let above = line_points(&right[right.len() - 1], &left[0], spacing);
        let below = line_points(&left[left.len() - 1], &right[0], spacing);
        vec![join(vec![right, above, left, below])]
    }

    fn faces(&self) -> Option<Vec<Arc<dyn LevelFunction<D>>>> {
        let ball = |side: f64| {
            let mut center = self.center;
            center[0] += side * self.half_separation;
            BallLevel { center, radius: self.radius }
        };
        let neck = TubeLevel { center: self.center, radius: self.neck_radius };
        Some(vec![Arc::new(ball(-1.0)), Arc::new(ball(1.0)), Arc::new(neck)])
    }
}
