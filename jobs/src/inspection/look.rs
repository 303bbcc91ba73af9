//! Looking into a file from outside. Runs in a process of its own, under limits.

use super::sandbox;
use crate::formats::checkpoint;
use crate::formats::mesh;
use crate::formats::structure::Structure;
use crate::formats::{cloud_file, structure, vtkhdf};
use crate::spec::body::resolved_scene;
use crate::spec::run_options::RunOptions;
use crate::spec::uploads::{
    ArrayContents, CheckpointContents, Contents, FaceContents, Inspection, MOST_POINTS, PointContents, Purpose,
};
use meniscus::scene::{self, Cloud};
use meniscus::scenes::SCENES;
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::Path;

/// Bytes of a mesh file at most.
const LARGEST_MESH: u64 = 1 << 30;

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
    let mut head = [0; 8];
    let length = file.read(&mut head).map_err(|error| error.to_string())?;
    let is_hdf5 = head[..length] == *structure::SIGNATURE;
    match purpose {
        Purpose::Surface | Purpose::Queries if !is_hdf5 => of_mesh(purpose, path),
        Purpose::Checkpoint => of_checkpoint(&file, path).map(|contents| (contents, None)),
        _ => of_points(purpose, &file, path).map(|(contents, cloud)| (contents, Some(cloud))),
    }
}

fn of_mesh(purpose: Purpose, path: &Path) -> Result<(Contents, Option<Cloud>), String> {
    let size = std::fs::metadata(path).map_err(|error| error.to_string())?.len();
    if size > LARGEST_MESH {
        return Err(format!("a mesh of {size} bytes; at most {LARGEST_MESH} are read"));
    }
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    let mesh = mesh::read(&bytes)?;
    let is_closed = (!mesh.faces.is_empty()).then(|| mesh.is_closed());
    let faces = FaceContents { faces: mesh.faces.len(), is_closed };
    // Places have no normals.
    let is_surface = purpose == Purpose::Surface;
    let has_normals = !mesh.normals.is_empty();
    let triangles = if is_surface { mesh.triangles() } else { Vec::new() };
    if triangles.len() as u64 > cloud_file::MOST_TRIANGLES {
        return Err(format!("{} triangles; at most {} are read", triangles.len(), cloud_file::MOST_TRIANGLES));
    }
    let normals = (is_surface && has_normals).then_some(mesh.normals);
    let cloud = Cloud { positions: mesh.points, level: None, normals, triangles };
    let contents = PointContents {
        normals: is_surface.then_some(has_normals),
        faces: is_surface.then_some(faces),
        ..point_contents(&cloud)
    };
    Ok((Contents::Points(contents), Some(cloud)))
}

/// Number of points, their fields and the box around them.
fn point_contents(cloud: &Cloud) -> PointContents {
    let bound = |pick: fn(f64, f64) -> f64, start: f64| -> [f64; 3] {
        std::array::from_fn(|d| cloud.positions.iter().map(|x| x[d]).fold(start, pick))
    };
    let phi = cloud.level.as_ref().map(|_| "phi".to_owned());
    let normal = cloud.normals.as_ref().map(|_| "normal".to_owned());
    PointContents {
        points: cloud.positions.len() as u64,
        fields: phi.into_iter().chain(normal).collect(),
        low: bound(f64::min, f64::INFINITY),
        high: bound(f64::max, f64::NEG_INFINITY),
        normals: None,
        faces: None,
    }
}

fn of_points(purpose: Purpose, file: &File, path: &Path) -> Result<(Contents, Cloud), String> {
    let structure = structure::read(file).map_err(|refusal| refusal.to_string())?;
    let has_normals = check_point_data(purpose, &structure)?;
    sandbox::shut_the_door(file).map_err(|error| error.to_string())?;
    let mut cloud = vtkhdf::read_cloud(path).map_err(|error| error.to_string())?;
    if has_normals {
        cloud.normals = vtkhdf::read_normals(path).map_err(|error| error.to_string())?;
    }
    // Places are asked about: what they may have beside does not matter.
    cloud.level = cloud.level.filter(|_| purpose == Purpose::Points);
    check_numbers(&cloud)?;
    let normals = (purpose == Purpose::Surface).then_some(has_normals);
    Ok((Contents::Points(PointContents { normals, ..point_contents(&cloud) }), cloud))
}

/// Checks type and extent of the data sets of points before libhdf5 reads them. Returns whether a surface has normals.
fn check_point_data(purpose: Purpose, structure: &Structure) -> Result<bool, String> {
    let points = structure.data_sets.get("/VTKHDF/Points").ok_or("there is no data set /VTKHDF/Points")?;
    let [count, 3] = points.extent.as_slice() else {
        return Err(format!("/VTKHDF/Points has the extent {:?}, not [n, 3]", points.extent));
    };
    let count = *count;
    if !points.is_float || count == 0 || count > MOST_POINTS {
        return Err(format!("/VTKHDF/Points must be 1 to {MOST_POINTS} points of floating-point numbers"));
    }
    match structure.data_sets.get("/VTKHDF/PointData/phi") {
        Some(phi) if !phi.is_float || phi.extent != [count] => {
            return Err(format!("/VTKHDF/PointData/phi must be {count} floating-point numbers, not {:?}", phi.extent));
        }
        None if purpose == Purpose::Points => {
            return Err("there is no data set /VTKHDF/PointData/phi (the level, positive outside)".to_owned());
        }
        _ => {}
    }
    let normal = structure.data_sets.get("/VTKHDF/PointData/normal").filter(|_| purpose == Purpose::Surface);
    if let Some(normal) = normal.filter(|normal| !normal.is_float || normal.extent != [count, 3]) {
        let found = &normal.extent;
        return Err(format!("/VTKHDF/PointData/normal must be [{count}, 3] floating-point numbers, not {found:?}"));
    }
    Ok(normal.is_some())
}

/// Refuses numbers that are not finite; a level may be missing at some points, where it is NaN.
fn check_numbers(cloud: &Cloud) -> Result<(), String> {
    if let Some(k) = cloud.positions.iter().position(|x| x.iter().any(|c| !c.is_finite())) {
        return Err(format!("the position of point {k} is not finite"));
    }
    if let Some(k) = cloud.normals.iter().flatten().position(|n| n.iter().any(|c| !c.is_finite())) {
        return Err(format!("the normal of point {k} is not finite"));
    }
    if let Some(k) = cloud.level.iter().flatten().position(|level| level.is_infinite()) {
        return Err(format!("phi of point {k} is infinite"));
    }
    if cloud.level.as_ref().is_some_and(|level| level.iter().all(|level| level.is_nan())) {
        return Err("no point has a phi that is a number".to_owned());
    }
    Ok(())
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
