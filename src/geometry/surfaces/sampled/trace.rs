//! Curves in the plane where a level is zero, traced point by point, and the area that they enclose.

use super::Vector;
use super::newton::project;
use crate::geometry::box_tree::BoxTree;
use crate::geometry::level::LevelFunction;

/// Share of the wanted spacing that a step takes, so that no two points are farther apart.
const SHARE: f64 = 0.95;
/// Largest turn of the curve in one step, in rad.
const LARGEST_TURN: f64 = 0.2;
/// Points of a chain at most.
const MOST_POINTS: usize = 5_000_000;
/// Halvings of a step that finds no point of the curve.
const MOST_HALVINGS: i32 = 12;

/// The curves through the seeds as closed chains of points at most `spacing` apart, with the inside on the left; none in space.
/// None where one of them does not close: then a part of the outline would be missing.
///
/// `longest` is a step within which no other branch of the same direction lies.
pub(in crate::geometry::surfaces) fn trace<const D: usize>(
    level: &dyn LevelFunction<D>,
    seeds: &[Vector<D>],
    spacing: f64,
    longest: f64,
) -> Option<Vec<Vec<Vector<D>>>> {
    if D != 2 {
        return Some(Vec::new());
    }
    let boxes: Vec<_> = seeds.iter().map(|x| (*x, *x)).collect();
    let tree = BoxTree::new(&boxes);
    let normals: Vec<Vector<D>> = seeds.iter().map(|x| level.jet(x).normal()).collect();
    let mut is_traced = vec![false; seeds.len()];
    let step = (SHARE * spacing).min(longest);
    let mut chains = Vec::new();
    for k in 0..seeds.len() {
        if is_traced[k] {
            continue;
        }
        let chain = trace_from(level, &seeds[k], step)?;
        for pair in chain.windows(2) {
            let (middle, half) = ((pair[0] + pair[1]) * 0.5, 0.6 * (pair[1] - pair[0]).norm().max(1e-3 * longest));
            let normal = right_of(&(pair[1] - pair[0]));
            tree.for_each_near(&middle, half, |item| {
                let is_here = (seeds[item] - middle).norm() <= half && normals[item].dot(&normal) > 0.0;
                is_traced[item] = is_traced[item] || is_here;
                half
            });
        }
        is_traced[k] = true;
        chains.push(chain);
    }
    Some(chains)
}

/// The closed curve through a point; None where it does not close.
fn trace_from<const D: usize>(level: &dyn LevelFunction<D>, start: &Vector<D>, step: f64) -> Option<Vec<Vector<D>>> {
    let mut chain = vec![*start];
    let mut y = *start;
    let mut length = 0.0;
    while chain.len() < MOST_POINTS {
        let jet = level.jet(&y);
        let tangent = left_of(&jet.normal());
        let turn = jet.sharpest_curvature();
        let step = if turn.is_finite() { step.min(LARGEST_TURN / turn.max(f64::MIN_POSITIVE)) } else { step };
        let back = start - y;
        if length > 2.0 * step && back.norm() <= step && back.dot(&tangent) >= 0.0 {
            chain.push(*start);
            return Some(chain);
        }
        // Beyond a kink the curve goes on along the tangent there.
        let beyond = left_of(&level.jet(&(y + tangent * step)).normal());
        let z = advance(level, &y, &tangent, step).or_else(|| advance(level, &y, &beyond, step))?;
        length += (z - y).norm();
        y = z;
        chain.push(y);
    }
    None
}

/// The next point of a curve along a tangent, at most a step away.
fn advance<const D: usize>(
    level: &dyn LevelFunction<D>,
    y: &Vector<D>,
    tangent: &Vector<D>,
    step: f64,
) -> Option<Vector<D>> {
    let is_ahead = |z: &Vector<D>, step: f64| (z - y).dot(tangent) > 0.2 * step;
    let steps = (0..MOST_HALVINGS).map(|k| step * 0.5_f64.powi(k));
    let mut found = steps.filter_map(|step| project(level, &(y + tangent * step), step).filter(|z| is_ahead(z, step)));
    found.next()
}

/// A vector of the plane turned by a right angle to the left.
fn left_of<const D: usize>(v: &Vector<D>) -> Vector<D> {
    let mut turned = Vector::<D>::zeros();
    (turned[0], turned[1]) = (-v[1], v[0]);
    turned
}

/// A vector of the plane turned by a right angle to the right.
fn right_of<const D: usize>(v: &Vector<D>) -> Vector<D> {
    -left_of(v)
}

/// The area within closed chains, inside on the left.
pub(in crate::geometry::surfaces) fn polygon_area<const D: usize>(chains: &[Vec<Vector<D>>]) -> f64 {
    let cross = |a: &Vector<D>, b: &Vector<D>| 0.5 * (a[0] * b[1] - a[1] * b[0]);
    let origin = chains.first().and_then(|chain| chain.first()).copied().unwrap_or_else(Vector::<D>::zeros);
    chains.iter().flat_map(|chain| chain.windows(2)).map(|pair| cross(&(pair[0] - origin), &(pair[1] - origin))).sum()
}

/// The area between the chords of a curve and the curve: for each chord that under the cubic with the slopes of the curve at
/// both ends, ∫h = c²/12 (h′(0) − h′(c)). The error falls with the fourth power of the spacing. `normal` is the normal of the
/// curve at its points, none at corners.
pub(in crate::geometry::surfaces) fn bulges<const D: usize>(
    chain: &[Vector<D>],
    normal: impl Fn(&Vector<D>) -> Option<Vector<D>>,
) -> f64 {
    let bulge = |pair: &[Vector<D>]| {
        let chord = pair[1] - pair[0];
        let length = chord.norm();
        if length <= 0.0 {
            return 0.0;
        }
        let (along, right) = (chord / length, right_of(&chord) / length);
        let slope = |x: &Vector<D>| {
            let tangent = left_of(&normal(x)?);
            Some(tangent.dot(&right) / tangent.dot(&along)).filter(|slope| slope.abs() <= LARGEST_TURN)
        };
        // At a kink the slope is that of another piece.
        match (slope(&pair[0]), slope(&pair[1])) {
            (Some(first), Some(last)) => length * length / 12.0 * (first - last),
            _ => 0.0,
        }
    };
    chain.windows(2).map(bulge).sum()
}
