//! Polygons (2D only): closed chains of straight edges that do not cross.

use super::{Surface, SurfacePoint, Vector, join, line_points};
use crate::geometry::box_tree::BoxTree;
use crate::geometry::level::{LevelFunction, PlaneLevel};
use std::sync::Arc;

/// Edges this near to each other touch, relative to the extent.
const TOUCH: f64 = 1e-12;
/// Sine of the angle below which neighboring edges are one straight line.
const STRAIGHT: f64 = 1e-12;

/// Why points are not the corners of a polygon. Points and edges count from 0; edge k begins at point k.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PolygonError {
    /// Fewer than three.
    #[error("a polygon has at least 3 points, here are {0}")]
    TooFew(usize),
    /// An edge without a length.
    #[error("points {0} and {1} are the same; give each corner once, the last one is joined to the first")]
    Repeated(usize, usize),
    /// Two edges with a point in common that is not a corner between them.
    #[error("edges {first} and {second} cross or touch near ({x:.4}, {y:.4}); edge k joins point k to the next one")]
    Crossing {
        /// The first edge.
        first: usize,
        /// The second edge.
        second: usize,
        /// Where.
        x: f64,
        /// Where.
        y: f64,
    },
}

/// A polygon with its corners in counterclockwise order.
#[derive(Debug, Clone)]
pub struct Polygon {
    points: Vec<Vector<2>>,
    /// Outward unit normal of the edge that begins at each point.
    normals: Vec<Vector<2>>,
    tree: BoxTree<2>,
}

/// The closest point of an edge: how far along it lies (0 to 1), the point and its distance.
type EdgeFoot = (f64, Vector<2>, f64);

impl Polygon {
    /// The polygon with these corners, in either order around it.
    ///
    /// # Errors
    /// [`PolygonError`]s, all of them: fewer than three points, points that repeat, edges that cross or touch.
    pub fn new(mut points: Vec<Vector<2>>) -> Result<Self, Vec<PolygonError>> {
        let errors = faults(&points);
        if !errors.is_empty() {
            return Err(errors);
        }
        if shoelace(&points) < 0.0 {
            points.reverse();
        }
        let edges = || points.iter().zip(points.iter().cycle().skip(1));
        let normals = edges().map(|(a, b)| Vector::<2>::new(b[1] - a[1], a[0] - b[0]).normalize()).collect();
        let boxes: Vec<_> = edges().map(|(a, b)| (a.inf(b), a.sup(b))).collect();
        Ok(Self { normals, tree: BoxTree::new(&boxes), points })
    }

    fn after(&self, k: usize) -> usize {
        if k + 1 == self.points.len() { 0 } else { k + 1 }
    }

    fn before(&self, k: usize) -> usize {
        if k == 0 { self.points.len() - 1 } else { k - 1 }
    }

    fn edge_foot(&self, k: usize, x: &Vector<2>) -> EdgeFoot {
        let (a, b) = (self.points[k], self.points[self.after(k)]);
        let along = b - a;
        let s = ((x - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        let point = if s == 1.0 { b } else { a + along * s };
        (s, point, (x - point).norm())
    }

    /// The edge of the closest point, and that point.
    fn nearest_edge(&self, x: &Vector<2>) -> (usize, EdgeFoot) {
        let mut best = (0, (0.0, *x, f64::INFINITY));
        self.tree.for_each_near(x, f64::INFINITY, |k| {
            let foot = self.edge_foot(k, x);
            // Of edges that share a corner the first one, in whatever order they come.
            if foot.2 < best.1.2 || foot.2 == best.1.2 && k < best.0 {
                best = (k, foot);
            }
            best.1.2
        });
        best
    }

    /// Outward direction at a place of an edge: its normal, at a corner the sum of both (the sign of a distance by it is right,
    /// Bærentzen and Aanæs 2005); and the normal where there is one.
    fn directions(&self, k: usize, s: f64) -> (Vector<2>, Option<Vector<2>>) {
        let own = self.normals[k];
        if s > 0.0 && s < 1.0 {
            return (own, Some(own));
        }
        let other = self.normals[if s == 0.0 { self.before(k) } else { self.after(k) }];
        let is_straight = own.dot(&other) > 0.0 && (own[0] * other[1] - own[1] * other[0]).abs() < STRAIGHT;
        (own + other, is_straight.then_some(own))
    }
}

impl Surface<2> for Polygon {
    fn nearest(&self, x: &Vector<2>) -> SurfacePoint<2> {
        let (k, (s, point, distance)) = self.nearest_edge(x);
        let (outward, normal) = self.directions(k, s);
        SurfacePoint {
            distance: if (x - point).dot(&outward) < 0.0 { -distance } else { distance },
            point,
            normal,
            curvature: normal.map(|_| 0.0),
        }
    }

    fn bounding_box(&self) -> (Vector<2>, Vector<2>) {
        let first = (self.points[0], self.points[0]);
        self.points.iter().fold(first, |whole, x| (whole.0.inf(x), whole.1.sup(x)))
    }

    fn area_or_volume(&self) -> f64 {
        shoelace(&self.points)
    }

    fn near_medial_axis(&self, x: &Vector<2>, tolerance: f64) -> bool {
        let (_, (_, nearest, best)) = self.nearest_edge(x);
        // Places where the distance along the outline is least: within edges, and at corners that both edges point to.
        let is_local = |k: usize, s: f64| match s {
            0.0 => self.edge_foot(self.before(k), x).0 == 1.0,
            1.0 => self.edge_foot(self.after(k), x).0 == 0.0,
            _ => true,
        };
        let mut is_near = false;
        let limit = best + 2.0 * tolerance;
        self.tree.for_each_near(x, limit, |k| {
            let (s, point, distance) = self.edge_foot(k, x);
            if distance <= limit && (point - nearest).norm() > TOUCH && is_local(k, s) {
                let apart = ((x - point) / distance - (x - nearest) / best.max(f64::MIN_POSITIVE)).norm();
                is_near = is_near || distance - best <= tolerance * apart;
            }
            limit
        });
        is_near
    }

    fn outline(&self, spacing: f64) -> Vec<Vec<Vector<2>>> {
        let edge = |k: usize| line_points(&self.points[k], &self.points[self.after(k)], spacing);
        vec![join((0..self.points.len()).map(edge).collect())]
    }

    fn faces(&self) -> Option<Vec<Arc<dyn LevelFunction<2>>>> {
        let edges = self.points.iter().zip(&self.normals);
        Some(edges.map(|(x, n)| -> Arc<dyn LevelFunction<2>> { Arc::new(PlaneLevel::through(x, *n)) }).collect())
    }
}

fn shoelace(points: &[Vector<2>]) -> f64 {
    let first = points[0];
    let cross = |a: Vector<2>, b: Vector<2>| 0.5 * (a[0] * b[1] - a[1] * b[0]);
    points.windows(2).map(|pair| cross(pair[0] - first, pair[1] - first)).sum()
}

/// Everything that keeps points from being the corners of a polygon.
fn faults(points: &[Vector<2>]) -> Vec<PolygonError> {
    let count = points.len();
    if count < 3 {
        return vec![PolygonError::TooFew(count)];
    }
    let after = |k: usize| (k + 1) % count;
    let low = points.iter().fold(points[0], |low, x| low.inf(x));
    let high = points.iter().fold(points[0], |high, x| high.sup(x));
    let touch = TOUCH * (high - low).max();
    let mut errors: Vec<PolygonError> = (0..count)
        .filter(|k| (points[after(*k)] - points[*k]).norm() <= touch)
        .map(|k| PolygonError::Repeated(k, after(k)))
        .collect();
    if !errors.is_empty() {
        return errors;
    }
    let boxes: Vec<_> =
        (0..count).map(|k| (points[k].inf(&points[after(k)]), points[k].sup(&points[after(k)]))).collect();
    let tree = BoxTree::new(&boxes);
    for first in 0..count {
        let (low, high) = (boxes[first].0.add_scalar(-touch), boxes[first].1.add_scalar(touch));
        let mut others = Vec::new();
        tree.for_each_overlapping(&low, &high, |second| others.push(second));
        others.sort_unstable();
        for second in others.into_iter().filter(|second| *second > first) {
            let ends = [points[first], points[after(first)], points[second], points[after(second)]];
            let at = if after(first) == second {
                folds_back(&ends[0], &ends[1], &ends[3])
            } else if after(second) == first {
                folds_back(&ends[2], &ends[0], &ends[1])
            } else {
                meeting(&ends, touch)
            };
            errors.extend(at.map(|at| PolygonError::Crossing { first, second, x: at[0], y: at[1] }));
        }
    }
    errors
}

/// The corner between two edges, where the second runs back along the first.
fn folds_back(a: &Vector<2>, corner: &Vector<2>, b: &Vector<2>) -> Option<Vector<2>> {
    let (u, v) = ((a - corner).normalize(), (b - corner).normalize());
    (u.dot(&v) > 0.0 && (u[0] * v[1] - u[1] * v[0]).abs() <= STRAIGHT).then_some(*corner)
}

/// A point that two straight pieces have in common, or nearly.
fn meeting([a, b, c, d]: &[Vector<2>; 4], touch: f64) -> Option<Vector<2>> {
    let side =
        |p: &Vector<2>, q: &Vector<2>, x: &Vector<2>| (q[0] - p[0]) * (x[1] - p[1]) - (q[1] - p[1]) * (x[0] - p[0]);
    let (c_side, d_side) = (side(a, b, c), side(a, b, d));
    if c_side * d_side < 0.0 && side(c, d, a) * side(c, d, b) < 0.0 {
        return Some(c + (d - c) * (c_side / (c_side - d_side)));
    }
    let on = |p: &Vector<2>, q: &Vector<2>, x: &Vector<2>| {
        let along = q - p;
        let s = ((x - p).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        ((p + along * s - x).norm() <= touch).then_some(*x)
    };
    on(a, b, c).or_else(|| on(a, b, d)).or_else(|| on(c, d, a)).or_else(|| on(c, d, b))
}
