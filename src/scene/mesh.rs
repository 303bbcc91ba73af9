//! Closed meshes from outside: triangles in space, or the corners of a polygon in the plane, in order.

use super::cloud::{self, Cloud, Clouds};
use crate::geometry::surfaces::{Polygon, Surface, TriangleMesh};
use crate::geometry::{Vector, dimension::in_dimension};
use crate::spec::Violation;
use serde_json::{Value, json};
use std::sync::Arc;

/// What is measured of a mesh before it is used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshSize {
    /// Surface area; of a polygon its length.
    pub area: f64,
    /// Enclosed volume; of a polygon its area.
    pub volume: f64,
}

/// The size of the mesh that a cloud is. Points without triangles are the corners of a polygon.
///
/// # Errors
/// Everything that keeps it from being a closed surface, a sentence each.
pub fn mesh_size(cloud: &Cloud) -> Result<MeshSize, Vec<String>> {
    if cloud.triangles.is_empty() {
        let points = plane_points(cloud)?;
        let volume = Polygon::new(points.clone()).map_err(sentences)?.area_or_volume();
        let area = points.iter().zip(points.iter().cycle().skip(1)).map(|(a, b)| (b - a).norm()).sum();
        return Ok(MeshSize { area, volume });
    }
    let points: Vec<Vector<3>> = cloud.positions.iter().map(|x| Vector::<3>::from(*x)).collect();
    let volume = TriangleMesh::new(&points, &cloud.triangles).map_err(sentences)?.area_or_volume();
    let area = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|k| points[k as usize]);
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    Ok(MeshSize { area: cloud.triangles.iter().map(area).sum(), volume })
}

fn plane_points(cloud: &Cloud) -> Result<Vec<Vector<2>>, Vec<String>> {
    if let Some(k) = cloud.positions.iter().position(|x| x[2] != 0.0) {
        let z = cloud.positions[k][2];
        return Err(vec![format!(
            "there are no triangles, and point {k} has z = {z}: it is no corner of a polygon in the plane; send a mesh with faces"
        )]);
    }
    Ok(cloud.positions.iter().map(|x| Vector::<2>::new(x[0], x[1])).collect())
}

fn sentences<T: ToString>(faults: Vec<T>) -> Vec<String> {
    faults.into_iter().map(|fault| fault.to_string()).collect()
}

/// The surface of the mesh that stands at a pointer of the scene.
///
/// # Errors
/// Everything that keeps it from being a closed surface in `D` dimensions.
pub fn surface<const D: usize>(clouds: &Clouds, pointer: &'static str) -> Result<Arc<dyn Surface<D>>, Vec<Violation>> {
    let refuse = |detail: String, allowed: Value| Violation::new(pointer, "data", detail, Value::Null, allowed);
    let points = cloud::points::<D>(clouds, pointer).map_err(|found| vec![found])?;
    let triangles = cloud::triangles(clouds, pointer).map_err(|found| vec![found])?;
    let found = if D == 3 {
        let points: Vec<Vector<3>> = points.iter().map(|x| Vector::<3>::from_fn(|d, _| x[d])).collect();
        TriangleMesh::new(&points, &triangles)
            .map(|mesh| in_dimension::<Arc<dyn Surface<3>>, Arc<dyn Surface<D>>>(Arc::new(mesh)))
            .map_err(sentences)
    } else if triangles.is_empty() {
        let points: Vec<Vector<2>> = points.iter().map(|x| Vector::<2>::new(x[0], x[1])).collect();
        Polygon::new(points)
            .map(|polygon| in_dimension::<Arc<dyn Surface<2>>, Arc<dyn Surface<D>>>(Arc::new(polygon)))
            .map_err(sentences)
    } else {
        let detail =
            "a mesh of triangles is a surface in space; give \"dimension\": 3, or the corners of a polygon in order";
        return Err(vec![refuse(detail.to_owned(), json!("points without faces"))]);
    };
    let all = |faults: Vec<String>| -> Vec<Violation> {
        faults.into_iter().map(|fault| refuse(fault, json!("a closed mesh"))).collect()
    };
    let missing = || vec![refuse("the mesh is of another dimension".to_owned(), Value::Null)];
    found.map_err(all)?.ok_or_else(missing)
}
