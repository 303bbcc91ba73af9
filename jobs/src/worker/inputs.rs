//! Points that a scene takes from files, as its worker reads them: uploads in the plain format that their inspection
//! wrote, local files of `meniscus run` as they are.

use crate::formats::mesh;
use crate::formats::{cloud_file, structure, vtkhdf};
use crate::spec::attempt_spec::AttemptSpec;
use meniscus::scene::{Cloud, CloudReference, CloudSource, Clouds, Scene};
use std::fs::File;
use std::path::Path;

/// Reads all points that a scene names.
///
/// # Errors
/// A sentence with the pointer, the name and the cause.
pub fn read(scene: &dyn Scene, spec: &AttemptSpec) -> Result<Clouds, String> {
    let read = |CloudReference { pointer, source }: CloudReference| {
        let (name, found) = match &source {
            CloudSource::File(file) => (file, read_local(Path::new(file), pointer)),
            CloudSource::Upload(id) => (id, read_upload(id, spec)),
        };
        found.map(|points| (pointer, points)).map_err(|cause| format!("{pointer} ({name}): {cause}"))
    };
    scene.clouds().into_iter().map(read).collect()
}

fn read_upload(id: &str, spec: &AttemptSpec) -> Result<Cloud, String> {
    let path = spec.inputs.get(id).ok_or("the upload is gone")?;
    File::open(path).and_then(|mut file| cloud_file::read(&mut file)).map_err(|error| error.to_string())
}

/// HDF5, else a mesh by what the bytes look like. Only a surface has normals: those of frames are NaN outside a band.
fn read_local(path: &Path, pointer: &str) -> Result<Cloud, String> {
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    if bytes.starts_with(structure::SIGNATURE) {
        let mut cloud = vtkhdf::read_cloud(path).map_err(|error| error.to_string())?;
        if pointer == "/surface" {
            cloud.normals = vtkhdf::read_normals(path).map_err(|error| error.to_string())?;
        }
        return Ok(cloud);
    }
    let mesh = mesh::read(&bytes)?;
    let triangles = mesh.triangles();
    let normals = (!mesh.normals.is_empty()).then_some(mesh.normals);
    Ok(Cloud { positions: mesh.points, level: None, normals, triangles })
}
