//! Points from outside: of a VTKHDF file, or of a mesh by what its bytes look like.

use super::mesh::{self, Mesh};
use super::{cloud_file, file_bytes, vtkhdf_points};
use crate::spec::uploads::{FaceContents, PointContents, Purpose};
use meniscus::scene::{Cloud, mesh_size};
use std::fs::File;

/// Reads the points of a file for a purpose, and says what was found.
///
/// # Errors
/// A sentence: what is wrong, where, and what helps.
pub fn read(file: &mut File, purpose: Purpose) -> Result<(PointContents, Cloud), String> {
    let is_hdf5 = file_bytes::is_hdf5(file)?;
    if is_hdf5 || purpose == Purpose::Points {
        let found = vtkhdf_points::read(file, purpose)?;
        let level = found.level;
        check_level(level.as_deref())?;
        return finish(found.mesh, level, purpose, is_hdf5);
    }
    finish(mesh::read(&file_bytes::all(file)?)?, None, purpose, false)
}

/// Checks numbers, leaves out what is no part of a surface, and describes what is there.
fn finish(
    mut mesh: Mesh,
    level: Option<Vec<f64>>,
    purpose: Purpose,
    is_hdf5: bool,
) -> Result<(PointContents, Cloud), String> {
    let is_surface = purpose == Purpose::Surface;
    let is_closed_mesh = purpose == Purpose::Mesh;
    if is_closed_mesh {
        // Its faces tell its normals.
        mesh.normals.clear();
    } else if !is_surface {
        // Places have neither normals nor faces.
        mesh = Mesh { points: mesh.points, ..Mesh::default() };
    }
    if !is_surface {
        mesh.columns.clear();
    }
    let left_out = mesh.leave_out_loose_points()?;
    mesh.check()?;
    // What is used as a closed mesh is closed, or refused below; its points may repeat.
    let is_closed = (!mesh.faces.is_empty()).then(|| is_closed_mesh || mesh.is_closed());
    let faces = FaceContents { faces: mesh.faces.len(), is_closed };
    let triangles = mesh.triangles();
    if triangles.len() as u64 > cloud_file::MOST_TRIANGLES {
        return Err(format!("{} triangles; at most {} are read", triangles.len(), cloud_file::MOST_TRIANGLES));
    }
    let normals = (!mesh.normals.is_empty()).then_some(mesh.normals);
    let Mesh { points, columns, kept, .. } = mesh;
    let cloud = Cloud { positions: points, level, normals, triangles, left_out, kept, columns, grid: None };
    let size = if is_closed_mesh { Some(mesh_size(&cloud).map_err(|faults| faults.join("; "))?) } else { None };
    let contents = PointContents {
        area: size.map(|size| size.area),
        volume: size.map(|size| size.volume),
        normals: is_surface.then_some(cloud.normals.is_some()),
        // Frames of particles have no faces to speak of.
        faces: (is_surface && !is_hdf5 || (is_surface || is_closed_mesh) && faces.faces > 0).then_some(faces),
        ..contents_of(&cloud)
    };
    Ok((contents, cloud))
}

/// Number of points, their fields and the box around them.
fn contents_of(cloud: &Cloud) -> PointContents {
    let bound = |pick: fn(f64, f64) -> f64, start: f64| -> [f64; 3] {
        std::array::from_fn(|d| cloud.positions.iter().map(|x| x[d]).fold(start, pick))
    };
    let phi = cloud.level.as_ref().map(|_| "phi".to_owned());
    let normal = cloud.normals.as_ref().map(|_| "normal".to_owned());
    PointContents {
        points: cloud.positions.len() as u64,
        fields: phi.into_iter().chain(normal).chain(cloud.columns.iter().map(|column| column.name.clone())).collect(),
        low: bound(f64::min, f64::INFINITY),
        high: bound(f64::max, f64::NEG_INFINITY),
        normals: None,
        faces: None,
        points_left_out: (cloud.left_out > 0).then_some(cloud.left_out),
        area: None,
        volume: None,
    }
}

/// Refuses levels that are infinite; a level may be missing at some points, where it is NaN.
fn check_level(level: Option<&[f64]>) -> Result<(), String> {
    let Some(level) = level else { return Ok(()) };
    if let Some(k) = level.iter().position(|level| level.is_infinite()) {
        return Err(format!("phi of point {k} is infinite"));
    }
    if level.iter().all(|level| level.is_nan()) {
        return Err("no point has a phi that is a number".to_owned());
    }
    Ok(())
}

#[cfg(test)]
mod tests;
