//! Curvatures of a surface of triangles (Meyer 2003): they hold where there are too few points for fits.
//!
//! The mean curvature normal of a corner is −½ Σ (cot α + cot β)/2 (x_j − x_i) by its area, where α and β lie opposite to the edge. The
//! Gauss curvature is 2π less the angles at the corner, by its area. The area is a third of that of the triangles about it.

use crate::geometry::Vector;
use std::collections::HashMap;

/// ∇·n and the Gauss curvature at each point with triangles all around; None elsewhere.
#[must_use]
pub fn curvatures<const D: usize>(
    points: &[Vector<D>],
    normals: &[Vector<D>],
    triangles: &[[u32; 3]],
) -> Vec<Option<[f64; 2]>> {
    let mut pull = vec![Vector::<D>::zeros(); points.len()];
    let (mut areas, mut angles) = (vec![0.0; points.len()], vec![0.0; points.len()]);
    let mut uses: HashMap<[u32; 2], u32> = HashMap::new();
    for corners in triangles {
        let at = corners.map(|corner| corner as usize);
        for k in 0..3 {
            let (i, j, l) = (at[(k + 1) % 3], at[(k + 2) % 3], at[k]);
            let (a, b) = (points[i] - points[l], points[j] - points[l]);
            let twice = (a.norm_squared() * b.norm_squared() - a.dot(&b).powi(2)).max(0.0).sqrt();
            areas[l] += twice / 6.0;
            angles[l] += twice.atan2(a.dot(&b));
            if twice > 0.0 {
                let exchange = (points[j] - points[i]) * (0.5 * a.dot(&b) / twice);
                pull[i] += exchange;
                pull[j] -= exchange;
            }
            let edge = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
            *uses.entry([edge[0].min(edge[1]), edge[0].max(edge[1])]).or_default() += 1;
        }
    }
    let mut is_inner: Vec<bool> = areas.iter().map(|area| *area > 0.0).collect();
    for ([i, j], _) in uses.iter().filter(|(_, uses)| **uses != 2) {
        (is_inner[*i as usize], is_inner[*j as usize]) = (false, false);
    }
    let at = |i: usize| {
        let (area, turn) = (areas[i], std::f64::consts::TAU - angles[i]);
        is_inner[i].then(|| [-pull[i].dot(&normals[i]) / area, turn / area])
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

    /// On a sphere of radius 2, κ = 1 and K = 1/4; the sum of K A is 4π to rounding (Gauss and Bonnet).
    #[test]
    fn a_sphere_has_its_curvatures() {
        let points: Vec<_> = fibonacci::sphere(2000).iter().map(|x| x * 2.0).collect();
        let cloud = PreparedCloud::new(&points, None, Cleaning::Drop).unwrap();
        let triangles = triangles(&cloud.points, &cloud.normals, &cloud.stars);
        let found = curvatures(&cloud.points, &cloud.normals, &triangles);
        for [kappa, gauss] in found.iter().map(|found| found.unwrap()) {
            assert!((kappa - 1.0).abs() < 0.05 && (gauss - 0.25).abs() < 0.03, "{kappa} {gauss}");
        }
        // Without one triangle, its corners have no curvature.
        let open = curvatures(&cloud.points, &cloud.normals, &triangles[1..]);
        assert_eq!(open.iter().filter(|found| found.is_none()).count(), 3);
    }
}
