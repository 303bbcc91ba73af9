//! Rays through a cloud: how often they cross the surface, whatever the sides of normals.
//!
//! A ray that leaves an outer side crosses the surface an even number of times, and one that leaves an inner side an odd number.

use super::star_graph::StarGraph;
use crate::geometry::Vector;

/// Points of a piece that send out rays, at most.
const SENDERS: usize = 24;
/// Distance of the start of a ray from its point, in sides of the point's cell.
const START: f64 = 0.75;
/// Radius of the disc that stands for a point, in sides of its cell.
const DISC: f64 = 1.6;
/// A number of crossings that is farther from a whole one says nothing.
const SHARP: f64 = 0.3;
/// Least share of the points of a piece whose rays must say something.
const LEAST_SHARE: f64 = 0.25;

/// Crossings of a ray with the points of a part, a number near a whole one.
///
/// A point stands for a disc with the weight A |n·d| K, where d is the direction of the ray. K is (1 − q²)² with the integral one,
/// and q is the distance from the ray by the radius of the disc.
fn crossings<const D: usize>(
    points: &[Vector<D>],
    normals: &[Vector<D>],
    graph: &StarGraph,
    part: &[usize],
    (start, direction): (Vector<D>, Vector<D>),
) -> f64 {
    // Integrals of (1 − q²)² over an interval and a disc.
    let whole = if D == 2 { 16.0 / 15.0 } else { std::f64::consts::FRAC_PI_3 };
    let mut sum = 0.0;
    for j in part.iter().copied() {
        let d = points[j] - start;
        let along = d.dot(&direction);
        if along <= 0.0 {
            continue;
        }
        let radius = DISC * side::<D>(graph.areas[j]);
        let q = (d.norm_squared() - along * along) / (radius * radius);
        if q < 1.0 {
            let kernel = (1.0 - q).powi(2) / (whole * radius.powi(D as i32 - 1));
            sum += graph.areas[j] * normals[j].dot(&direction).abs() * kernel;
        }
    }
    sum
}

/// Side of a cell with the given area, or length on a curve.
fn side<const D: usize>(area: f64) -> f64 {
    if D == 2 { area } else { area.sqrt() }
}

/// Share of the points of a piece of a part whose normals point outward, of those whose two rays say so or the contrary. None where too few
/// do, as on an open surface: both of its sides are outer ones.
pub(super) fn outward_share<const D: usize>(
    points: &[Vector<D>],
    normals: &[Vector<D>],
    graph: &StarGraph,
    (part, piece): (&[usize], &[usize]),
) -> Option<f64> {
    let stride = piece.len().div_ceil(SENDERS).max(1);
    let (mut sent, mut outward, mut inward) = (0, 0, 0);
    for i in piece.iter().step_by(stride).copied() {
        let is_odd = |direction: Vector<D>| {
            let start = points[i] + direction * (START * side::<D>(graph.areas[i]));
            let number = crossings(points, normals, graph, part, (start, direction));
            let nearest = number.round();
            ((number - nearest).abs() < SHARP).then_some(nearest % 2.0 == 1.0)
        };
        sent += 1;
        match (is_odd(normals[i]), is_odd(-normals[i])) {
            (Some(false), Some(true)) => outward += 1,
            (Some(true), Some(false)) => inward += 1,
            _ => {}
        }
    }
    let said = f64::from(outward + inward);
    (said > 0.0 && said >= LEAST_SHARE * f64::from(sent)).then(|| f64::from(outward) / said)
}

#[cfg(test)]
mod tests {
    use super::outward_share;
    use crate::geometry::{Vector, fibonacci};
    use crate::point_clouds::preparation::spacings_and_graph;

    #[test]
    fn rays_tell_the_outer_side_of_a_body_with_a_hole() {
        let points: Vec<Vector<3>> = fibonacci::sphere(400).into_iter().filter(|x| x[2] < 0.6).collect();
        let (_, graph) = spacings_and_graph(&points, &points);
        let all: Vec<usize> = (0..points.len()).collect();
        let share = outward_share(&points, &points, &graph, (&all, &all)).unwrap();
        assert!(share > 0.8, "{share}");
        let inward: Vec<_> = points.iter().map(|n| -n).collect();
        assert!(outward_share(&points, &inward, &graph, (&all, &all)).unwrap() < 0.2);
    }

    /// The wall of a cup: its inner side is a piece that looks like a ball with its normals inward.
    #[test]
    fn the_inner_wall_of_a_cup_keeps_its_side() {
        let ball = fibonacci::sphere(1500);
        let wall =
            |radius: f64| ball.iter().filter(|x| x[2] < 0.5).map(move |x| (x * radius, *x * (radius - 0.9).signum()));
        let (points, normals): (Vec<Vector<3>>, Vec<Vector<3>>) = wall(1.0).chain(wall(0.8)).unzip();
        let (_, graph) = spacings_and_graph(&points, &normals);
        // The rim would join them.
        let all: Vec<usize> = (0..points.len()).collect();
        let inner: Vec<usize> = (points.len() / 2..points.len()).collect();
        let share = outward_share(&points, &normals, &graph, (&all, &inner)).unwrap();
        assert!(share > 0.8, "{share}");
    }

    #[test]
    fn a_flat_patch_has_two_outer_sides() {
        let points: Vec<Vector<3>> =
            (0..400).map(|k| Vector::<3>::new(f64::from(k % 20), f64::from(k / 20), 0.0) * 0.1).collect();
        let normals = vec![Vector::<3>::z(); 400];
        let (_, graph) = spacings_and_graph(&points, &normals);
        let all: Vec<usize> = (0..400).collect();
        assert_eq!(outward_share(&points, &normals, &graph, (&all, &all)), None);
    }
}
