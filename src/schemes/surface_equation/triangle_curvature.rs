//! Curvatures of a surface of triangles (Meyer 2003): they hold where there are too few points for fits.
//!
//! The mean curvature normal of a corner is −½ Σ (cot α + cot β)/2 (x_j − x_i) by its area, where α and β lie opposite to the edge. The
//! Gauss curvature is 2π less the angles at the corner, by its area. The area is that of the Voronoi cell; a triangle with an obtuse
//! angle gives half of its area to that corner, and a quarter to each other one.

use crate::geometry::Vector;
use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, TAU};

/// ∇·n of a point with triangles, and the Gauss curvature of one with triangles all around.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerCurvature {
    /// ∇·n; None without triangles.
    pub bend: Option<f64>,
    /// The Gauss curvature; None at an edge of the triangles.
    pub gauss: Option<f64>,
}

/// A triangle: the angle at each corner, its cotangent, and the area.
struct Shape {
    angles: [f64; 3],
    cotangents: [f64; 3],
    area: f64,
}

fn shape<const D: usize>(points: &[Vector<D>], at: [usize; 3]) -> Option<Shape> {
    let sides = |k: usize| (points[at[(k + 1) % 3]] - points[at[k]], points[at[(k + 2) % 3]] - points[at[k]]);
    let (a, b) = sides(0);
    let twice = (a.norm_squared() * b.norm_squared() - a.dot(&b).powi(2)).max(0.0).sqrt();
    let along: [f64; 3] = std::array::from_fn(|k| sides(k).0.dot(&sides(k).1));
    (twice > 0.0).then(|| Shape {
        angles: along.map(|along| twice.atan2(along)),
        cotangents: along.map(|along| along / twice),
        area: 0.5 * twice,
    })
}

/// Curvatures at the corners of triangles that are counter-clockwise about the outer side. The normal of a corner is that of the
/// triangles about it, by area: at a crease other normals are those of one side.
#[must_use]
pub fn curvatures<const D: usize>(points: &[Vector<D>], triangles: &[[u32; 3]]) -> Vec<CornerCurvature> {
    let mut normals = vec![Vector::<D>::zeros(); points.len()];
    let mut pull = vec![Vector::<D>::zeros(); points.len()];
    let (mut areas, mut angles) = (vec![0.0; points.len()], vec![0.0; points.len()]);
    let mut uses: HashMap<[u32; 2], u32> = HashMap::new();
    for corners in triangles {
        let at = corners.map(|corner| corner as usize);
        for k in 0..3 {
            let edge = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
            *uses.entry([edge[0].min(edge[1]), edge[0].max(edge[1])]).or_default() += 1;
        }
        let (a, b) = (points[at[1]] - points[at[0]], points[at[2]] - points[at[0]]);
        let cross = Vector::<D>::from_fn(|d, _| a[(d + 1) % D] * b[(d + 2) % D] - a[(d + 2) % D] * b[(d + 1) % D]);
        at.iter().for_each(|i| normals[*i] += cross);
        let Some(shape) = shape(points, at) else { continue };
        let obtuse = shape.angles.iter().position(|angle| *angle > FRAC_PI_2);
        for (k, cotangent) in shape.cotangents.iter().enumerate() {
            let (i, j, l) = (at[(k + 1) % 3], at[(k + 2) % 3], at[k]);
            let edge = points[j] - points[i];
            pull[i] += edge * (0.5 * cotangent);
            pull[j] -= edge * (0.5 * cotangent);
            angles[l] += shape.angles[k];
            match obtuse {
                Some(place) => areas[l] += shape.area * if place == k { 0.5 } else { 0.25 },
                None => {
                    let half = 0.125 * cotangent * edge.norm_squared();
                    areas[i] += half;
                    areas[j] += half;
                }
            }
        }
    }
    let mut is_inner = vec![true; points.len()];
    for ([i, j], _) in uses.iter().filter(|(_, uses)| **uses != 2) {
        (is_inner[*i as usize], is_inner[*j as usize]) = (false, false);
    }
    let at = |i: usize| {
        let has_area = areas[i] > 0.0 && normals[i].norm() > 0.0;
        CornerCurvature {
            bend: has_area.then(|| -pull[i].dot(&normals[i].normalize()) / areas[i]),
            gauss: (has_area && is_inner[i]).then(|| (TAU - angles[i]) / areas[i]),
        }
    };
    (0..points.len()).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::curvatures;
    use crate::geometry::fibonacci;
    use crate::point_clouds::PreparedCloud;
    use crate::point_clouds::cleaning::Cleaning;
    use crate::point_clouds::triangulation::triangles;

    /// On a sphere of radius 2, κ = 1 and K = 1/4.
    #[test]
    fn a_sphere_has_its_curvatures() {
        let points: Vec<_> = fibonacci::sphere(2000).iter().map(|x| x * 2.0).collect();
        let cloud = PreparedCloud::new(&points, None, Cleaning::Drop).unwrap();
        let triangles = triangles(&cloud.points, &cloud.normals, &cloud.stars);
        for found in curvatures(&cloud.points, &triangles) {
            let (bend, gauss) = (found.bend.unwrap(), found.gauss.unwrap());
            assert!((bend - 1.0).abs() < 0.05 && (gauss - 0.25).abs() < 0.02, "{bend} {gauss}");
        }
        // Without one triangle, its corners have no Gauss curvature.
        let open = curvatures(&cloud.points, &triangles[1..]);
        assert_eq!(open.iter().filter(|found| found.gauss.is_none()).count(), 3);
        assert!(curvatures(&cloud.points, &[]).iter().all(|found| found.bend.is_none()));
    }
}
