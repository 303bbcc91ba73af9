//! Edges of a surface: points with open stars in a row, and the direction out of the surface there.
//!
//! The edge is the line through these points. Its direction at a point is that of the parabola through the point and one neighbor
//! on either side, which is known to second order.

use super::star_graph::StarGraph;
use crate::geometry::Vector;
use crate::geometry::frame::normal_to;

/// Largest cosine of the angle between the ways to the neighbors on either side. At a right-angled corner it is zero.
const OPPOSITE: f64 = 0.4;

/// The unit conormal of every point of an edge: it is tangent to the surface, orthogonal to the edge, and points out of the
/// surface. None at other points, and at single points with an open star.
#[must_use]
pub fn conormals<const D: usize>(
    points: &[Vector<D>],
    normals: &[Vector<D>],
    graph: &StarGraph,
) -> Vec<Option<Vector<D>>> {
    let at = |i: usize| if D == 2 { at_end(points, graph, i) } else { at_edge(points, normals, graph, i) };
    (0..points.len()).map(|i| if graph.is_open(i) { at(i) } else { None }).collect()
}

/// Fewest points with a conormal in a row. Open stars by chance lie alone or in small groups.
const LEAST_ROW: usize = 5;

/// Whether each point is of an edge: its star is open, and it has a conormal or lies beside a point that has one, in a row of
/// several. At a sharp corner a point has no conormal of its own.
#[must_use]
pub fn in_rows<const D: usize>(conormals: &[Option<Vector<D>>], graph: &StarGraph) -> Vec<bool> {
    let count = conormals.len();
    if D == 2 {
        return conormals.iter().map(Option::is_some).collect();
    }
    let mut is_seen = vec![false; count];
    let mut is_in_row = vec![false; count];
    for start in 0..count {
        if is_seen[start] || conormals[start].is_none() {
            continue;
        }
        is_seen[start] = true;
        let mut row = vec![start];
        let mut place = 0;
        while let Some(i) = row.get(place).copied() {
            place += 1;
            for j in open_neighbors(graph, i) {
                if conormals[j].is_some() && !is_seen[j] {
                    is_seen[j] = true;
                    row.push(j);
                }
            }
        }
        if row.len() >= LEAST_ROW {
            for i in row {
                is_in_row[i] = true;
                let beside = graph.neighbors(i).iter().map(|j| *j as usize).filter(|j| graph.is_open(*j));
                beside.for_each(|j| is_in_row[j] = true);
            }
        }
    }
    is_in_row
}

/// The conormal at the end of a curve.
fn at_end<const D: usize>(points: &[Vector<D>], graph: &StarGraph, i: usize) -> Option<Vector<D>> {
    let [j] = graph.neighbors(i) else { return None };
    let d = points[i] - points[*j as usize];
    (d.norm() > 0.0).then(|| d.normalize())
}

/// The conormal at the edge of a surface.
fn at_edge<const D: usize>(
    points: &[Vector<D>],
    normals: &[Vector<D>],
    graph: &StarGraph,
    i: usize,
) -> Option<Vector<D>> {
    let to = |j: usize| points[j] - points[i];
    let mut along = open_neighbors(graph, i);
    // Equal distances are told apart by index.
    along.sort_by(|a, b| to(*a).norm_squared().total_cmp(&to(*b).norm_squared()).then(a.cmp(b)));
    let first = to(*along.first()?);
    let is_opposite = |j: &&usize| to(**j).dot(&first) < OPPOSITE * to(**j).norm() * first.norm();
    let second = to(*along.iter().find(is_opposite)?);
    let (one, other) = (first.norm(), second.norm());
    // The slope of the parabola through the neighbors at −|first| and |second|.
    let tangent = second * (one / other) - first * (other / one);
    let conormal = normal_to::<D, 2>(&[normals[i], tangent]);
    let inward = graph.neighbors(i).iter().fold(Vector::<D>::zeros(), |sum, j| sum + to(*j as usize).normalize());
    let side = conormal.dot(&inward);
    (side.is_finite() && side != 0.0).then(|| if side < 0.0 { conormal } else { -conormal })
}

/// Points with open stars among the neighbors of a point and among theirs.
fn open_neighbors(graph: &StarGraph, i: usize) -> Vec<usize> {
    let near = graph.neighbors(i).iter().map(|j| *j as usize);
    let mut found: Vec<usize> = near
        .flat_map(|j| std::iter::once(j).chain(graph.neighbors(j).iter().map(|k| *k as usize)))
        .filter(|j| *j != i && graph.is_open(*j))
        .collect();
    found.sort_unstable();
    found.dedup();
    found
}

#[cfg(test)]
mod tests {
    use super::conormals;
    use crate::geometry::Vector;
    use crate::point_clouds::preparation::spacings_and_graph;

    /// A cap of a sphere with rings of points, the last one on its edge.
    #[test]
    fn conormals_of_a_cap_are_known_to_second_order() {
        let cap = |rings: i32| -> Vec<Vector<3>> {
            let step = 1.2 / f64::from(rings);
            let ring = |k: i32| {
                let polar = f64::from(k) * step;
                let count = (std::f64::consts::TAU * polar.sin() / step).round().max(1.0) as i32;
                (0..count).map(move |m| {
                    let angle = std::f64::consts::TAU * (f64::from(m) + 0.3 * f64::from(k % 3)) / f64::from(count);
                    Vector::<3>::new(polar.sin() * angle.cos(), polar.sin() * angle.sin(), polar.cos())
                })
            };
            (0..=rings).flat_map(ring).collect()
        };
        let off = |rings: i32| {
            let points = cap(rings);
            let (_, graph) = spacings_and_graph(&points, &points);
            let edge = 1.2_f64.cos() + 1e-9;
            let mut most = 0.0_f64;
            for (x, conormal) in points.iter().zip(conormals(&points, &points, &graph)) {
                assert_eq!(conormal.is_some(), x[2] < edge, "{x}");
                let Some(conormal) = conormal else { continue };
                let polar = x[2].acos();
                let exact = Vector::<3>::new(x[0] * x[2] / polar.sin(), x[1] * x[2] / polar.sin(), -polar.sin());
                most = most.max((conormal - exact).norm());
            }
            most
        };
        assert!(off(10) < 1e-6 && off(20) < 1e-6, "{} {}", off(10), off(20));
    }

    #[test]
    fn a_curve_has_two_ends_and_a_corner_its_diagonal() {
        let line: Vec<_> = (0..20).map(|i| Vector::<2>::new(f64::from(i) * 0.1, 0.0)).collect();
        let (_, graph) = spacings_and_graph(&line, &vec![Vector::<2>::y(); 20]);
        let found = conormals(&line, &vec![Vector::<2>::y(); 20], &graph);
        assert_eq!((found[0], found[19]), (Some(-Vector::<2>::x()), Some(Vector::<2>::x())));
        assert!(found[1..19].iter().all(Option::is_none));
        let patch: Vec<_> = (0..100).map(|k| Vector::<3>::new(f64::from(k % 10), f64::from(k / 10), 0.0)).collect();
        let up = vec![Vector::<3>::z(); 100];
        let (_, graph) = spacings_and_graph(&patch, &up);
        let found = conormals(&patch, &up, &graph);
        assert_eq!(found.iter().flatten().count(), 36);
        assert!((found[5].unwrap() + Vector::<3>::y()).norm() < 1e-12);
        let diagonal = Vector::<3>::new(-1.0, -1.0, 0.0).normalize();
        assert!((found[0].unwrap() - diagonal).norm() < 1e-12);
    }
}
