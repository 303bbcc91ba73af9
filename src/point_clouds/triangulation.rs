//! Triangles of a cloud for pictures, from its stars.
//!
//! A point and two neighbors with consecutive facets are a triangle of its star. Where the stars of its three points agree, the
//! triangle has three votes; four points on a circle give triangles with one vote. Triangles are taken in the order of their votes,
//! unless one of their edges has a triangle on that side already, so that the result is a surface.

use super::stars::Stars;
use crate::geometry::Vector;
use std::collections::HashSet;

/// Triangles as indices of their corners, counter-clockwise about the unit normals; none for curves.
///
/// ```
/// use meniscus::geometry::fibonacci;
/// use meniscus::point_clouds::{PreparedCloud, cleaning::Cleaning, triangulation::triangles};
///
/// let cloud = PreparedCloud::new(&fibonacci::sphere(500), None, Cleaning::Drop).unwrap();
/// // Euler: a closed surface of genus 0 has 2 n − 4 triangles.
/// assert_eq!(triangles(&cloud.points, &cloud.normals, &cloud.stars).len(), 996);
/// ```
#[must_use]
pub fn triangles<const D: usize>(points: &[Vector<D>], normals: &[Vector<D>], stars: &Stars) -> Vec<[u32; 3]> {
    if D != 3 {
        return Vec::new();
    }
    let mut candidates: Vec<[u32; 3]> = Vec::new();
    for i in 0..stars.len() {
        let facets = stars.facets(i);
        for (k, facet) in facets.iter().enumerate().filter(|(_, facet)| facet.is_joined) {
            let next = facets[(k + 1) % facets.len()].neighbor;
            let mut corners = [i as u32, facet.neighbor, next];
            corners.sort_unstable();
            if corners[0] != corners[1] && corners[1] != corners[2] {
                candidates.push(corners);
            }
        }
    }
    candidates.sort_unstable();
    let mut voted: Vec<([u32; 3], usize)> =
        candidates.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect();
    // The sort is stable, so that triangles of equal votes keep their order.
    voted.sort_by_key(|(_, votes)| std::cmp::Reverse(*votes));
    let mut taken = HashSet::new();
    let mut found = Vec::with_capacity(voted.len());
    for (corners, _) in voted {
        let corners = turned(points, normals, corners);
        let edges = [0, 1, 2].map(|k| (corners[k], corners[(k + 1) % 3]));
        if edges.iter().all(|edge| !taken.contains(edge)) {
            taken.extend(edges);
            found.push(corners);
        }
    }
    found
}

/// Triangles that came with a cloud, on the points that stay. `places` has the index there of each given point. Those that have lost
/// a corner are left out, and so are repeated ones.
///
/// They keep the order of their corners, or are turned together, where nearly all agree with the normals on their outer side. At a
/// crease the normals of the points are less sure than they are. Otherwise each is turned by its normals.
#[must_use]
pub fn given_triangles<const D: usize>(
    given: &[[u32; 3]],
    places: &[Option<u32>],
    (points, normals): (&[Vector<D>], &[Vector<D>]),
) -> Vec<[u32; 3]> {
    if D != 3 {
        return Vec::new();
    }
    let mut taken = HashSet::new();
    let on_kept = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| places[corner as usize]);
        let corners = [a?, b?, c?];
        let mut sorted = corners;
        sorted.sort_unstable();
        let is_new = sorted[0] != sorted[1] && sorted[1] != sorted[2] && taken.insert(sorted);
        is_new.then_some(corners)
    };
    let mut found: Vec<[u32; 3]> = given.iter().filter_map(on_kept).collect();
    let by_normals: Vec<[u32; 3]> = found.iter().map(|corners| turned(points, normals, *corners)).collect();
    let other = found.iter().zip(&by_normals).filter(|(given, turned)| given != turned).count() as f64;
    let share = other / found.len().max(1) as f64;
    if (FEW..1.0 - FEW).contains(&share) {
        return by_normals;
    }
    if share > 0.5 {
        found.iter_mut().for_each(|corners| corners.swap(1, 2));
    }
    found
}

/// Share of triangles that may disagree with the normals where all are on one side.
const FEW: f64 = 0.05;

/// The corners, counter-clockwise about the sum of their normals.
fn turned<const D: usize>(points: &[Vector<D>], normals: &[Vector<D>], [i, j, k]: [u32; 3]) -> [u32; 3] {
    let [a, b, c] = [i, j, k].map(|corner| corner as usize);
    let (e, f) = (points[b] - points[a], points[c] - points[a]);
    let normal = normals[a] + normals[b] + normals[c];
    let cross = |d: usize| e[(d + 1) % D] * f[(d + 2) % D] - e[(d + 2) % D] * f[(d + 1) % D];
    let volume: f64 = (0..D).map(|d| normal[d] * cross(d)).sum();
    if volume < 0.0 { [i, k, j] } else { [i, j, k] }
}

#[cfg(test)]
mod tests {
    use super::triangles;
    use crate::geometry::random::CounterRandom;
    use crate::geometry::{Vector, fibonacci};
    use crate::point_clouds::PreparedCloud;
    use crate::point_clouds::cleaning::Cleaning;

    fn of(points: &[Vector<3>]) -> (PreparedCloud<3>, Vec<[u32; 3]>) {
        let cloud = PreparedCloud::new(points, None, Cleaning::Drop).unwrap();
        let found = triangles(&cloud.points, &cloud.normals, &cloud.stars);
        (cloud, found)
    }

    /// Sum of (x_j − x_i) × (x_k − x_i)/2 · n_i, the area with its sign.
    fn area(cloud: &PreparedCloud<3>, found: &[[u32; 3]]) -> f64 {
        let one = |[i, j, k]: &[u32; 3]| {
            let [a, b, c] = [i, j, k].map(|corner| cloud.points[*corner as usize]);
            0.5 * (b - a).cross(&(c - a)).dot(&cloud.normals[*i as usize])
        };
        found.iter().map(one).sum()
    }

    #[test]
    fn a_random_sphere_is_closed_and_faces_outward() {
        let random = CounterRandom::new(2);
        let draw = |i: i64| Vector::<3>::from_fn(|d, _| random.symmetric(&[i, d as i64]));
        let points: Vec<_> =
            (0..).map(draw).filter(|x| (0.1..1.0).contains(&x.norm())).map(|x| x.normalize()).take(1500).collect();
        let (cloud, found) = of(&points);
        assert!(found.len() > 2_950 && found.len() <= 2_996, "{}", found.len());
        let whole = area(&cloud, &found) / (4.0 * std::f64::consts::PI);
        assert!((whole - 1.0).abs() < 1e-2, "{whole}");
        assert_eq!(of(&fibonacci::sphere(800)).1.len(), 1596);
    }

    /// Four points of a square lie on a circle: one of its diagonals is taken.
    #[test]
    fn a_lattice_is_covered_once() {
        let points: Vec<_> = (0..400).map(|k| Vector::<3>::new(f64::from(k % 20), f64::from(k / 20), 0.0)).collect();
        let (cloud, found) = of(&points);
        assert_eq!(found.len(), 2 * 19 * 19);
        assert!((area(&cloud, &found) - 361.0).abs() < 1e-9);
    }
}
