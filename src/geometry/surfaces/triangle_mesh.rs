//! Closed meshes of triangles in space, with exact distances.
//!
//! The closest point lies within a triangle, on an edge or at a corner. The sign of the distance is that of the way from there
//! along the pseudo-normal: the normal of the triangle, the sum of both at an edge, and at a corner the sum weighted by the
//! angles (Bærentzen and Aanæs 2005). The tree of [`BoxTree`] serves polygons, patches and meshes alike; a library of its
//! own for meshes alone would still leave the checks, the normals at flat edges and the curvature to us.

mod faults;

pub use faults::MeshFault;

use super::{Surface, SurfacePoint, Vector};
use crate::geometry::box_tree::BoxTree;
use std::collections::HashMap;

/// Cosine of the angle between a triangle and the pseudo-normal beside it beyond which an edge is sharp: 30°. The normals of
/// other edges stand for those of the smooth surface that the mesh approximates.
const SMOOTH: f64 = 0.866;
/// Least difference of the directions to two closest points between which the medial axis lies.
const APART: f64 = 0.7;

/// A closed surface of triangles, counterclockwise as seen from outside.
#[derive(Debug, Clone)]
pub struct TriangleMesh {
    points: Vec<Vector<3>>,
    triangles: Vec<[u32; 3]>,
    /// Unit normal of each triangle; zero where it has no area.
    normals: Vec<Vector<3>>,
    /// Sum of the normals at each edge of each triangle; edge k runs from corner k to the next.
    edge_normals: Vec<[Vector<3>; 3]>,
    /// Sum of the normals at each point, weighted by the angles.
    point_normals: Vec<Vector<3>>,
    /// Whether no sharp edge meets at a point.
    is_smooth: Vec<bool>,
    /// Mean of the curvatures of the triangles at each point, weighted by their areas.
    point_curvatures: Vec<f64>,
    tree: BoxTree<3>,
}

/// Where on a triangle a closest point lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Feature {
    Inside,
    Edge(usize),
    Corner(usize),
}

/// The closest point of a triangle.
#[derive(Debug, Clone, Copy)]
struct TriangleFoot {
    triangle: usize,
    feature: Feature,
    point: Vector<3>,
    distance: f64,
}

impl TriangleMesh {
    /// The mesh of these triangles. Points at the same place are one; triangles may all be turned inside out.
    ///
    /// # Errors
    /// Everything that keeps the mesh from being a closed surface: open edges, edges of more than two triangles, neighbors that are
    /// turned against each other, triangles that cross.
    pub fn new(points: &[Vector<3>], triangles: &[[u32; 3]]) -> Result<Self, Vec<MeshFault>> {
        let (points, mut triangles) = merged(points, triangles);
        faults::check_edges(&points, &triangles)?;
        if volume(&points, &triangles) < 0.0 {
            triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        }
        let corner = |k: u32| points[k as usize];
        let boxes: Vec<_> = triangles
            .iter()
            .map(|[a, b, c]| {
                let (a, b, c) = (corner(*a), corner(*b), corner(*c));
                (a.inf(&b).inf(&c), a.sup(&b).sup(&c))
            })
            .collect();
        let tree = BoxTree::new(&boxes);
        faults::check_crossings(&points, &triangles, &boxes, &tree)?;
        let normal = |[a, b, c]: &[u32; 3]| {
            let cross = (corner(*b) - corner(*a)).cross(&(corner(*c) - corner(*a)));
            cross.try_normalize(0.0).unwrap_or_else(Vector::<3>::zeros)
        };
        let normals: Vec<Vector<3>> = triangles.iter().map(normal).collect();
        let mut mesh = Self {
            edge_normals: edge_normals(&triangles, &normals),
            point_normals: vec![Vector::<3>::zeros(); points.len()],
            is_smooth: vec![true; points.len()],
            point_curvatures: vec![0.0; points.len()],
            points,
            triangles,
            normals,
            tree,
        };
        mesh.set_point_normals();
        mesh.set_point_curvatures();
        Ok(mesh)
    }

    fn corners(&self, triangle: usize) -> [Vector<3>; 3] {
        self.triangles[triangle].map(|k| self.points[k as usize])
    }

    fn set_point_normals(&mut self) {
        for (k, corners) in self.triangles.iter().enumerate() {
            let x = self.corners(k);
            for (a, point) in corners.iter().enumerate() {
                let (u, v) = (x[(a + 1) % 3] - x[a], x[(a + 2) % 3] - x[a]);
                let angle = u.angle(&v);
                if angle.is_finite() {
                    self.point_normals[*point as usize] += self.normals[k] * angle;
                }
            }
        }
        for normal in &mut self.point_normals {
            *normal = normal.try_normalize(0.0).unwrap_or_else(Vector::<3>::zeros);
        }
        for (corners, normal) in self.triangles.iter().zip(&self.normals) {
            for point in corners {
                let point = *point as usize;
                self.is_smooth[point] &=
                    *normal == Vector::<3>::zeros() || normal.dot(&self.point_normals[point]) > SMOOTH;
            }
        }
    }

    fn set_point_curvatures(&mut self) {
        let mut areas = vec![0.0; self.points.len()];
        for (k, corners) in self.triangles.iter().enumerate() {
            let (area, curvature) = (double_area(&self.corners(k)), self.curvature_of(k));
            for point in corners {
                areas[*point as usize] += area;
                self.point_curvatures[*point as usize] += area * curvature;
            }
        }
        for (curvature, area) in self.point_curvatures.iter_mut().zip(areas) {
            *curvature = if area > 0.0 { *curvature / area } else { 0.0 };
        }
    }

    fn foot(&self, triangle: usize, x: &Vector<3>) -> TriangleFoot {
        let (feature, point) = closest_of_triangle(&self.corners(triangle), x);
        TriangleFoot { triangle, feature, point, distance: (x - point).norm() }
    }

    fn closest(&self, x: &Vector<3>) -> TriangleFoot {
        let mut best = TriangleFoot { triangle: 0, feature: Feature::Inside, point: *x, distance: f64::INFINITY };
        self.tree.for_each_near(x, f64::INFINITY, |triangle| {
            let foot = self.foot(triangle, x);
            // Of triangles that share an edge the first one, in whatever order they come.
            if foot.distance < best.distance || foot.distance == best.distance && triangle < best.triangle {
                best = foot;
            }
            best.distance
        });
        best
    }

    /// Outward direction at a foot, and the normal where the surface is smooth.
    fn directions(&self, foot: &TriangleFoot) -> (Vector<3>, Option<Vector<3>>) {
        let own = self.normals[foot.triangle];
        match foot.feature {
            Feature::Inside => (own, Some(own)),
            Feature::Edge(k) => {
                let outward = self.edge_normals[foot.triangle][k];
                let unit = outward.try_normalize(0.0);
                (outward, unit.filter(|unit| unit.dot(&own) > SMOOTH))
            }
            Feature::Corner(k) => {
                let point = self.triangles[foot.triangle][k] as usize;
                let outward = self.point_normals[point];
                (outward, self.is_smooth[point].then_some(outward))
            }
        }
    }

    /// ∇·n = Σ ∇λ_i · n_i of the normals at the corners, interpolated over a triangle. At a corner on a sharp edge the normal of the
    /// triangle counts.
    fn curvature_of(&self, triangle: usize) -> f64 {
        let x = self.corners(triangle);
        let normal = self.normals[triangle];
        let at_corner = |k: usize| {
            let point = self.triangles[triangle][k] as usize;
            let own = if self.is_smooth[point] { self.point_normals[point] } else { normal };
            // ∇λ_k = n × (opposite edge)/(2 A).
            normal.cross(&(x[(k + 2) % 3] - x[(k + 1) % 3])).dot(&own)
        };
        let area = double_area(&x);
        if area > 0.0 { (0..3).map(at_corner).sum::<f64>() / area } else { 0.0 }
    }

    /// The curvature at a foot, interpolated between the corners: single triangles have that of their own shape, too. At a corner on
    /// a sharp edge the curvature of the triangle counts.
    fn curvature(&self, foot: &TriangleFoot) -> f64 {
        let x = self.corners(foot.triangle);
        let own = self.curvature_of(foot.triangle);
        let at_corner = |k: usize| {
            let point = self.triangles[foot.triangle][k] as usize;
            let share = double_area(&[foot.point, x[(k + 1) % 3], x[(k + 2) % 3]]);
            share * if self.is_smooth[point] { self.point_curvatures[point] } else { own }
        };
        let area = double_area(&x);
        if area > 0.0 { (0..3).map(at_corner).sum::<f64>() / area } else { own }
    }
}

fn double_area([a, b, c]: &[Vector<3>; 3]) -> f64 {
    (b - a).cross(&(c - a)).norm()
}

impl Surface<3> for TriangleMesh {
    fn nearest(&self, x: &Vector<3>) -> SurfacePoint<3> {
        let foot = self.closest(x);
        let (outward, normal) = self.directions(&foot);
        SurfacePoint {
            distance: if (x - foot.point).dot(&outward) < 0.0 { -foot.distance } else { foot.distance },
            point: foot.point,
            normal,
            curvature: normal.map(|_| self.curvature(&foot)),
        }
    }

    fn bounding_box(&self) -> (Vector<3>, Vector<3>) {
        let first = (self.points[0], self.points[0]);
        self.points.iter().fold(first, |whole, x| (whole.0.inf(x), whole.1.sup(x)))
    }

    fn area_or_volume(&self) -> f64 {
        volume(&self.points, &self.triangles)
    }

    /// Whether two closest points in clearly different directions are about equally near.
    fn near_medial_axis(&self, x: &Vector<3>, tolerance: f64) -> bool {
        let nearest = self.closest(x);
        let direction = |point: &Vector<3>, distance: f64| (x - point) / distance.max(f64::MIN_POSITIVE);
        let first = direction(&nearest.point, nearest.distance);
        let limit = nearest.distance + 2.0 * tolerance;
        let mut is_near = nearest.distance <= 0.0 && nearest.feature != Feature::Inside;
        self.tree.for_each_near(x, limit, |triangle| {
            let foot = self.foot(triangle, x);
            if foot.distance <= limit {
                let apart = (direction(&foot.point, foot.distance) - first).norm();
                is_near |= apart > APART && foot.distance - nearest.distance <= tolerance * apart;
            }
            if is_near { -1.0 } else { limit }
        });
        is_near
    }

    fn outline(&self, _spacing: f64) -> Vec<Vec<Vector<3>>> {
        Vec::new()
    }
}

/// Points at the same place as one, and the triangles that have three corners then.
fn merged(points: &[Vector<3>], triangles: &[[u32; 3]]) -> (Vec<Vector<3>>, Vec<[u32; 3]>) {
    let mut places: HashMap<[u64; 3], u32> = HashMap::new();
    let mut kept: Vec<Vector<3>> = Vec::new();
    let mut index = Vec::with_capacity(points.len());
    for x in points {
        // −0 and 0 are one place.
        let key = [x[0], x[1], x[2]].map(|c| (c + 0.0).to_bits());
        let place = *places.entry(key).or_insert_with(|| {
            kept.push(*x);
            kept.len() as u32 - 1
        });
        index.push(place);
    }
    let renamed = triangles.iter().map(|corners| corners.map(|k| index[k as usize]));
    (kept, renamed.filter(|[a, b, c]| a != b && b != c && c != a).collect())
}

/// The sums of the normals of both triangles at each edge.
fn edge_normals(triangles: &[[u32; 3]], normals: &[Vector<3>]) -> Vec<[Vector<3>; 3]> {
    let directed = |corners: &[u32; 3], k: usize| (corners[k], corners[(k + 1) % 3]);
    let mut of_edge: HashMap<(u32, u32), usize> = HashMap::new();
    for (triangle, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            of_edge.insert(directed(corners, k), triangle);
        }
    }
    let sum = |triangle: usize, corners: &[u32; 3], k: usize| {
        let (a, b) = directed(corners, k);
        normals[triangle] + of_edge.get(&(b, a)).map_or_else(Vector::<3>::zeros, |other| normals[*other])
    };
    triangles.iter().enumerate().map(|(t, corners)| std::array::from_fn(|k| sum(t, corners, k))).collect()
}

/// The enclosed volume Σ a·(b × c)/6, about the first point.
fn volume(points: &[Vector<3>], triangles: &[[u32; 3]]) -> f64 {
    let first = points.first().copied().unwrap_or_else(Vector::<3>::zeros);
    let of = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|k| points[k as usize] - first);
        a.dot(&b.cross(&c)) / 6.0
    };
    triangles.iter().map(of).sum()
}

/// The closest point of a triangle (Ericson, Real-Time Collision Detection, 5.1.5): by the signs of the products that tell the
/// regions of corners, edges and the inside apart.
fn closest_of_triangle([a, b, c]: &[Vector<3>; 3], x: &Vector<3>) -> (Feature, Vector<3>) {
    let (ab, ac, ax) = (b - a, c - a, x - a);
    let (d1, d2) = (ab.dot(&ax), ac.dot(&ax));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (Feature::Corner(0), *a);
    }
    let bx = x - b;
    let (d3, d4) = (ab.dot(&bx), ac.dot(&bx));
    if d3 >= 0.0 && d4 <= d3 {
        return (Feature::Corner(1), *b);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (Feature::Edge(0), a + ab * (d1 / (d1 - d3)));
    }
    let cx = x - c;
    let (d5, d6) = (ab.dot(&cx), ac.dot(&cx));
    if d6 >= 0.0 && d5 <= d6 {
        return (Feature::Corner(2), *c);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (Feature::Edge(2), a + ac * (d2 / (d2 - d6)));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (Feature::Edge(1), b + (c - b) * share);
    }
    let total = va + vb + vc;
    (Feature::Inside, a + ab * (vb / total) + ac * (vc / total))
}

#[cfg(test)]
mod tests;
