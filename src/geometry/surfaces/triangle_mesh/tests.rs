//! Meshes against the shapes that they stand for.

use super::{MeshFault, TriangleMesh, Vector};
use crate::geometry::Surface;
use crate::geometry::random::CounterRandom;
use crate::geometry::surfaces::{Ball, Cuboid};
use std::collections::HashMap;

/// A sphere of 20·4^levels triangles: an icosahedron whose edges are halved, with points moved onto the sphere.
fn icosphere(levels: u32, radius: f64) -> (Vec<Vector<3>>, Vec<[u32; 3]>) {
    let t = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut points: Vec<Vector<3>> = Vec::new();
    for (a, b) in [(1.0, t), (-1.0, t), (1.0, -t), (-1.0, -t)] {
        points.extend([Vector::<3>::new(0.0, a, b), Vector::<3>::new(a, b, 0.0), Vector::<3>::new(b, 0.0, a)]);
    }
    let near = |a: &Vector<3>, b: &Vector<3>| ((a - b).norm() - 2.0).abs() < 1e-9;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let (x, y, z) = (points[a], points[b], points[c]);
                if near(&x, &y) && near(&y, &z) && near(&z, &x) {
                    let is_outward = (y - x).cross(&(z - x)).dot(&x) > 0.0;
                    triangles.push(if is_outward { [a, b, c] } else { [a, c, b] }.map(|k| k as u32));
                }
            }
        }
    }
    for _ in 0..levels {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]) * 0.5);
                points.len() as u32 - 1
            })
        };
        let halve = |[a, b, c]: [u32; 3]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(halve).collect();
        points.iter_mut().for_each(|x| *x = x.normalize());
    }
    (points.iter().map(|x| x.normalize() * radius).collect(), triangles)
}

/// The box of a cuboid as twelve triangles.
fn cube(size: f64) -> (Vec<Vector<3>>, Vec<[u32; 3]>) {
    let corner = |k: u32| Vector::<3>::from_fn(|d, _| size * (f64::from(k >> d & 1) - 0.5));
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    ((0..8).map(corner).collect(), quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect())
}

fn queries(count: i64) -> Vec<Vector<3>> {
    let random = CounterRandom::new(3);
    (0..count).map(|i| Vector::<3>::from_fn(|d, _| 1.2 * random.symmetric(&[i, d as i64]))).collect()
}

/// spec/inputs.md: a sphere of 20,480 triangles equals `sphere` to the mesh's own error, which is the sagitta of its edges.
#[test]
fn an_icosphere_is_a_sphere_to_its_own_error() {
    let (points, triangles) = icosphere(5, 0.7);
    assert_eq!(triangles.len(), 20_480);
    let mesh = TriangleMesh::new(&points, &triangles).unwrap();
    let ball = Ball { center: Vector::<3>::zeros(), radius: 0.7 };
    let longest = triangles
        .iter()
        .flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]])
        .map(|[a, b]| (points[a as usize] - points[b as usize]).norm())
        .fold(0.0, f64::max);
    // The farthest point of a triangle from its corners is at most edge/√3 away.
    let sagitta = longest * longest / 3.0 / (2.0 * 0.7) * 1.01;
    assert!(sagitta < 4e-4, "{sagitta}");
    for x in queries(5000) {
        let (found, exact) = (mesh.nearest(&x), ball.nearest(&x));
        let beyond = found.distance - exact.distance;
        assert!((-1e-12..sagitta).contains(&beyond), "{x:?}: {found:?} for {exact:?}");
        assert!((found.distance.abs() - (x - found.point).norm()).abs() < 1e-13);
        let normal = found.normal.expect("a smooth mesh has normals everywhere");
        let expected = found.point.normalize();
        assert!((normal - expected).norm() < longest, "{normal:?} for {expected:?}");
        let curvature = found.curvature.unwrap();
        // Normals at points whose triangles differ in size are a little off.
        assert!((curvature - 2.0 / 0.7).abs() < 0.03 * 2.0 / 0.7, "{curvature} at {expected:?}");
    }
    assert!((mesh.area_or_volume() / ball.area_or_volume() - 1.0).abs() < 2e-3);
    assert!(mesh.near_medial_axis(&Vector::<3>::new(1e-4, 0.0, 0.0), 1e-3));
    assert!(!mesh.near_medial_axis(&Vector::<3>::new(0.3, 0.1, 0.2), 1e-3));
}

#[test]
fn a_box_of_triangles_is_the_box() {
    let (points, triangles) = cube(1.0);
    let mesh = TriangleMesh::new(&points, &triangles).unwrap();
    let cuboid = Cuboid { center: Vector::<3>::zeros(), size: Vector::<3>::repeat(1.0) };
    assert!((mesh.area_or_volume() - 1.0).abs() < 1e-15);
    for x in queries(5000) {
        let (found, exact) = (mesh.nearest(&x), cuboid.nearest(&x));
        assert!((found.distance - exact.distance).abs() < 1e-14, "{x:?}: {found:?} for {exact:?}");
        assert_eq!(found.normal.is_none(), exact.normal.is_none(), "{x:?}: {found:?} for {exact:?}");
        if !cuboid.near_medial_axis(&x, 1e-9) {
            assert!((found.point - exact.point).norm() < 1e-14, "{x:?}: {found:?} for {exact:?}");
            assert!(found.curvature.is_none_or(|curvature| curvature.abs() < 1e-14));
        }
    }
    // Turned inside out as a whole, and with the corners of each triangle for themselves, as STL has them.
    let turned: Vec<[u32; 3]> = triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let soup: Vec<Vector<3>> = turned.iter().flatten().map(|k| points[*k as usize]).collect();
    let alone: Vec<[u32; 3]> = (0..12).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let again = TriangleMesh::new(&soup, &alone).unwrap();
    for x in queries(200) {
        assert_eq!(again.signed_distance(&x).to_bits(), mesh.signed_distance(&x).to_bits());
    }
}

#[test]
fn open_and_turned_and_crossing_meshes_are_refused_by_name() {
    let (points, triangles) = cube(1.0);
    assert_eq!(TriangleMesh::new(&points, &[]).unwrap_err(), [MeshFault::Empty]);
    let open = TriangleMesh::new(&points, &triangles[1..]).unwrap_err();
    assert_eq!(open.len(), 3);
    assert!(open[0].to_string().starts_with("edge from (-0.5000, -0.5000, -0.5000) to"), "{}", open[0]);
    let mut turned = triangles.clone();
    turned[0].swap(1, 2);
    let found = TriangleMesh::new(&points, &turned).unwrap_err();
    assert!(found.len() == 3 && found.iter().all(|fault| matches!(fault, MeshFault::Turned { .. })), "{found:?}");
    let twice: Vec<[u32; 3]> = triangles.iter().chain(&triangles).copied().collect();
    let found = TriangleMesh::new(&points, &twice).unwrap_err();
    assert!(found.iter().all(|fault| matches!(fault, MeshFault::Shared { count: 4, .. })), "{found:?}");
    assert!(found.last().unwrap().to_string().contains("and 13 more"), "{}", found.last().unwrap());
    // Two boxes through each other.
    let moved = points.iter().map(|x| x + Vector::<3>::new(0.3, 0.4, 0.2));
    let both: Vec<Vector<3>> = points.iter().copied().chain(moved).collect();
    let all: Vec<[u32; 3]> = triangles.iter().copied().chain(triangles.iter().map(|t| t.map(|k| k + 8))).collect();
    let found = TriangleMesh::new(&both, &all).unwrap_err();
    assert!(found.iter().all(|fault| matches!(fault, MeshFault::Crossing { .. })), "{found:?}");
    // Side by side they are one mesh of two parts.
    let apart: Vec<Vector<3>> =
        points.iter().copied().chain(points.iter().map(|x| x + Vector::<3>::new(1.5, 0.0, 0.0))).collect();
    assert!((TriangleMesh::new(&apart, &all).unwrap().area_or_volume() - 2.0).abs() < 1e-14);
}
