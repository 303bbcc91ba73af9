//! Points that a scene takes from files, as its worker reads them: uploads in the plain format that their inspection
//! wrote, local files of `meniscus run` as they are.

use crate::formats::{cloud_file, outside_file};
use crate::spec::attempt_spec::AttemptSpec;
use crate::spec::uploads::Purpose;
use meniscus::scene::{Cloud, CloudReference, CloudRole, CloudSource, Clouds, Scene};
use std::fs::File;
use std::path::Path;

/// Reads all points that a scene names.
///
/// # Errors
/// A sentence with the pointer, the name and the cause.
pub fn read(scene: &dyn Scene, spec: &AttemptSpec) -> Result<Clouds, String> {
    let read = |CloudReference { pointer, role, source }: CloudReference| {
        let (name, found) = match &source {
            CloudSource::File(file) => (file, read_local(Path::new(file), role)),
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

/// A local file, as the inspection of uploads reads it.
fn read_local(path: &Path, role: CloudRole) -> Result<Cloud, String> {
    let purpose = match role {
        CloudRole::Surface => Purpose::Surface,
        CloudRole::Queries => Purpose::Queries,
        CloudRole::Points => Purpose::Points,
        CloudRole::Mesh => Purpose::Mesh,
        CloudRole::Values => Purpose::Values,
        CloudRole::Flow => Purpose::Flow,
    };
    let mut file = File::open(path).map_err(|error| error.to_string())?;
    outside_file::read(&mut file, purpose).map(|(_, cloud)| cloud)
}
