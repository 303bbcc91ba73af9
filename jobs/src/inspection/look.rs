//! Looking into a file from outside. Runs in a process of its own, under limits.

use super::sandbox;
use crate::formats::{checkpoint, cloud_file, outside_file, structure};
use crate::spec::body::resolved_scene;
use crate::spec::run_options::RunOptions;
use crate::spec::uploads::{ArrayContents, CheckpointContents, Contents, Inspection, Purpose};
use meniscus::scene::{self, Cloud};
use meniscus::scenes::SCENES;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Looks into a file and writes to `out` what was found: an
/// [`Inspection`] as a line of JSON and, of points, the points behind it.
///
/// # Errors
/// When it cannot be written.
pub fn run(purpose: Purpose, path: &Path, out: &mut dyn Write) -> io::Result<()> {
    let mut out = BufWriter::new(out);
    match inspect(purpose, path) {
        Ok((contents, cloud)) => {
            writeln!(out, "{}", serde_json::to_string(&Inspection::Ready(contents))?)?;
            if let Some(cloud) = cloud {
                cloud_file::write(&mut out, &cloud)?;
            }
        }
        Err(reason) => writeln!(out, "{}", serde_json::to_string(&Inspection::Rejected(reason))?)?,
    }
    out.flush()
}

fn inspect(purpose: Purpose, path: &Path) -> Result<(Contents, Option<Cloud>), String> {
    let mut file = File::open(path).map_err(|error| error.to_string())?;
    if purpose == Purpose::Checkpoint {
        return of_checkpoint(&file, path).map(|contents| (contents, None));
    }
    sandbox::shut_the_door(&file).map_err(|error| error.to_string())?;
    outside_file::read(&mut file, purpose).map(|(contents, cloud)| (contents, Some(cloud)))
}

fn of_checkpoint(file: &File, path: &Path) -> Result<Contents, String> {
    let structure = structure::read(file).map_err(|refusal| refusal.to_string())?;
    for name in ["/meta", "/meta_sha256"] {
        let text = structure.data_sets.get(name).ok_or_else(|| format!("there is no data set {name}"))?;
        if text.element_bytes != 1 || text.extent.len() != 1 {
            return Err(format!("{name} is no text"));
        }
    }
    sandbox::shut_the_door(file).map_err(|error| error.to_string())?;
    let (meta, _) = checkpoint::read(path, None).map_err(|error| error.to_string())?;
    let none_of_this_build = |error| format!("its body is none of this build: {error}");
    let scene = resolved_scene(&meta.body).map_err(none_of_this_build)?;
    let scene = scene::parse(&scene, SCENES).map_err(|found| {
        let first = found.first().map_or_else(String::new, |v| format!("{}: {}", v.pointer, v.detail));
        format!("its scene is none of this build: {first}")
    })?;
    RunOptions::from_resolved(&meta.body).map_err(none_of_this_build)?;
    if !scene.clouds().is_empty() {
        return Err("its scene takes points from elsewhere, which are not part of the checkpoint".to_owned());
    }
    let arrays = meta.list().into_iter();
    let arrays = arrays.map(|(name, components)| ArrayContents { name: name.to_owned(), components }).collect();
    Ok(Contents::Checkpoint(CheckpointContents {
        arrays,
        body: meta.body,
        step: meta.step,
        time: meta.time,
        isa: meta.isa,
        build: meta.build,
        job: meta.job,
    }))
}
