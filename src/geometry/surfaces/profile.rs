//! Curves made of circular arcs and straight lines in a plane: the boundary of shapes that are glued together.

use super::Vector;
use std::f64::consts::PI;

/// One piece of a curve; normals point to the outside of the shape.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Piece {
    /// Part of a circle about `center`, from angle `middle − half_width` to `middle + half_width`, outside away from it.
    Arc { center: Vector<2>, radius: f64, middle: f64, half_width: f64 },
    /// A straight line with its outward normal.
    Line { from: Vector<2>, to: Vector<2>, normal: Vector<2> },
}

/// The closest point of a piece.
#[derive(Debug, Clone, Copy)]
pub(super) struct PieceFoot {
    pub distance: f64,
    pub point: Vector<2>,
    /// None at the ends of the piece, where another one begins.
    pub normal: Option<Vector<2>>,
    /// 1/radius on arcs, 0 on lines.
    pub curvature: f64,
}

impl Piece {
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

/// The nearest and the second nearest distance over the pieces.
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

/// An angle brought into [−π, π].
fn turn(angle: f64) -> f64 {
    angle - (angle / (2.0 * PI)).round() * 2.0 * PI
}
