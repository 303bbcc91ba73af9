//! Plane curves of circular arcs and straight lines, the boundaries of composed shapes.

use super::Vector;
use std::f64::consts::PI;

/// One piece of a curve. Normals point out of the shape.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Piece {
    /// Arc of a circle from the angle `middle − half_width` to `middle + half_width` (rad), with the center inside the
    /// shape.
    Arc { center: Vector<2>, radius: f64, middle: f64, half_width: f64 },
    /// A straight line with its outward normal.
    Line { from: Vector<2>, to: Vector<2>, normal: Vector<2> },
}

/// Closest point of a piece to a query point.
#[derive(Debug, Clone, Copy)]
pub(super) struct PieceFoot {
    /// Distance ≥ 0 from the query point.
    pub distance: f64,
    /// The closest point.
    pub point: Vector<2>,
    /// Outward unit normal; None at the ends of the piece.
    pub normal: Option<Vector<2>>,
    /// Curvature of the piece: 1/radius on arcs, 0 on lines.
    pub curvature: f64,
}

impl Piece {
    /// The closest point of this piece to `x`.
    pub(super) fn nearest(&self, x: &Vector<2>) -> PieceFoot {
        match self {
            Piece::Arc { center, radius, middle, half_width } => {
                let offset = x - center;
                let length = offset.norm();
                let axis = Vector::<2>::new(middle.cos(), middle.sin());
                let angle = if length > 0.0 { turn(offset[1].atan2(offset[0]) - middle) } else { 0.0 };
                let curvature = 1.0 / radius;
                if angle.abs() < *half_width {
                    let normal = if length > 0.0 { offset / length } else { axis };
                    return PieceFoot {
                        distance: (length - radius).abs(),
                        point: center + normal * *radius,
                        normal: Some(normal),
                        curvature,
                    };
                }
                let end = middle + half_width.copysign(angle);
                let point = center + Vector::<2>::new(end.cos(), end.sin()) * *radius;
                PieceFoot { distance: (x - point).norm(), point, normal: None, curvature }
            }
            Piece::Line { from, to, normal } => {
                let along = to - from;
                let s = (x - from).dot(&along) / along.norm_squared();
                let point = from + along * s.clamp(0.0, 1.0);
                let inner = s > 0.0 && s < 1.0;
                PieceFoot { distance: (x - point).norm(), point, normal: inner.then_some(*normal), curvature: 0.0 }
            }
        }
    }
}

/// The closest point over all pieces, and the distance to the nearest piece with another closest point.
pub(super) fn nearest_of(pieces: &[Piece], x: &Vector<2>) -> (PieceFoot, f64) {
    let mut best = pieces[0].nearest(x);
    let mut second = f64::INFINITY;
    for piece in &pieces[1..] {
        let foot = piece.nearest(x);
        if foot.distance < best.distance {
            if (foot.point - best.point).norm() > 1e-12 {
                second = best.distance;
            }
            best = foot;
        } else if (foot.point - best.point).norm() > 1e-12 {
            second = second.min(foot.distance);
        }
    }
    (best, second)
}

/// An angle (rad) moved into [−π, π].
fn turn(angle: f64) -> f64 {
    angle - (angle / (2.0 * PI)).round() * 2.0 * PI
}
