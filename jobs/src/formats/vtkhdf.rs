//! Frames as VTKHDF `PolyData` (version 2.0): every particle is a vertex. ParaView, VTK, PyVista and h5py open them.
//!
//! VTK's reader needs all four topology groups, and numbers only under `FieldData`.

use super::hdf5_file::write;
use super::surface_view;
use hdf5::types::FixedAscii;
use hdf5::{File, Group};
use meniscus::scene::Cloud;
use meniscus::simulation::{FieldValues, Fields};
use std::path::Path;

/// Writes the chosen fields of one moment; the file is closed when this returns.
///
/// # Errors
/// Whatever libhdf5 reports.
pub fn write_frame(path: &Path, fields: &Fields, chosen: &[String], time: f64, step: u64) -> hdf5::Result<()> {
    let file = File::create(path)?;
    let root = file.create_group("VTKHDF")?;
    root.new_attr::<i64>().shape(2).create("Version")?.write_raw(&[2_i64, 0])?;
    let kind = FixedAscii::<8>::from_ascii(b"PolyData").map_err(|e| hdf5::Error::from(e.to_string()))?;
    root.new_attr::<FixedAscii<8>>().create("Type")?.write_scalar(&kind)?;
    let count = fields.points.len();
    write(&root, "NumberOfPoints", 1, &[count as i64])?;
    write(&root, "Points", 3, fields.points.as_flattened())?;
    let places: Vec<i64> = (0..=count as i64).collect();
    topology(&root, "Vertices", &places, &places[..count])?;
    for name in ["Lines", "Polygons", "Strips"] {
        topology(&root, name, &[0], &[])?;
    }
    let data = root.create_group("PointData")?;
    for field in fields.columns.iter().filter(|field| chosen.iter().any(|name| name == field.name)) {
        match &field.values {
            FieldValues::Scalar(values) => write(&data, field.name, 1, values)?,
            FieldValues::Vector(values) => write(&data, field.name, 3, values.as_flattened())?,
            FieldValues::Id(values) => write(&data, field.name, 1, values)?,
        };
    }
    let moment = root.create_group("FieldData")?;
    write(&moment, "Time", 1, &[time])?;
    write(&moment, "Step", 1, &[step as i64])?;
    file.close()
}

fn topology(root: &Group, name: &str, offsets: &[i64], connectivity: &[i64]) -> hdf5::Result<()> {
    let group = root.create_group(name)?;
    write(&group, "NumberOfCells", 1, &[offsets.len() as i64 - 1])?;
    write(&group, "NumberOfConnectivityIds", 1, &[connectivity.len() as i64])?;
    write(&group, "Offsets", 1, offsets)?;
    write(&group, "Connectivity", 1, connectivity)?;
    Ok(())
}

/// What a picture needs of a frame.
#[derive(Debug, Clone, Default)]
pub struct FrameView {
    /// Scene time.
    pub time: f64,
    /// Positions.
    pub points: Vec<[f64; 3]>,
    /// Signed distances, NaN outside the band; of a field on a surface its values about the middle of their range.
    pub phi: Vec<f64>,
    /// Closest points and normals, where the frame has both.
    pub surface: Vec<([f64; 3], [f64; 3])>,
}

/// Reads a frame back, for a picture; None where it has neither `phi` nor a `value` on a surface nor is a front.
///
/// # Errors
/// Whatever libhdf5 reports.
pub fn read_frame(path: &Path) -> hdf5::Result<Option<FrameView>> {
    let file = File::open(path)?;
    let root = file.group("VTKHDF")?;
    let data = root.group("PointData")?;
    let triples = |values: Vec<f64>| values.as_chunks::<3>().0.to_vec();
    let time = root.dataset("FieldData/Time")?.read_raw::<f64>()?.first().copied().unwrap_or(0.0);
    let points = triples(root.dataset("Points")?.read_raw()?);
    let Ok(phi) = data.dataset("phi") else {
        let Ok(normals) = data.dataset("normal") else { return Ok(None) };
        let normals = triples(normals.read_raw()?);
        if let Ok(values) = data.dataset("value") {
            let (points, phi) = surface_view::seen(&points, &normals, &values.read_raw::<f64>()?);
            return Ok(Some(FrameView { time, points, phi, surface: Vec::new() }));
        }
        // The points of a front are all on it: a line in the plane, shaded by its slope in space.
        if data.dataset("grid_point").is_err() {
            return Ok(None);
        }
        // That of a wave front, a curve in (x, y, θ), is drawn in the plane too.
        if normals.iter().all(|n| n[2] == 0.0) {
            let points: Vec<[f64; 3]> = points.iter().map(|x| [x[0], x[1], 0.0]).collect();
            let phi = vec![0.0; points.len()];
            let surface = points.iter().copied().zip(normals).collect();
            return Ok(Some(FrameView { time, points, phi, surface }));
        }
        let slopes: Vec<f64> = normals.iter().map(|n| n[2]).collect();
        let (points, phi) = surface_view::seen(&points, &normals, &slopes);
        return Ok(Some(FrameView { time, points, phi, surface: Vec::new() }));
    };
    let surface = match (data.dataset("closest_point"), data.dataset("normal")) {
        (Ok(points), Ok(normals)) => {
            triples(points.read_raw()?).into_iter().zip(triples(normals.read_raw()?)).collect()
        }
        _ => Vec::new(),
    };
    Ok(Some(FrameView { time, points, phi: phi.read_raw()?, surface }))
}

/// φ and a scalar field of a frame, where it has both.
///
/// # Errors
/// Whatever libhdf5 reports.
pub fn read_profile(path: &Path, field: &str) -> hdf5::Result<Option<Vec<(f64, f64)>>> {
    let data = File::open(path)?.group("VTKHDF/PointData")?;
    let (Ok(phi), Ok(values)) = (data.dataset("phi"), data.dataset(field)) else { return Ok(None) };
    Ok(Some(phi.read_raw()?.into_iter().zip(values.read_raw()?).collect()))
}

/// Reads points, and `phi` where there is one, from a frame or any file that is laid out like one.
///
/// # Errors
/// Whatever libhdf5 reports, and points that are no triples.
pub fn read_cloud(path: &Path) -> Result<Cloud, CloudError> {
    let root = File::open(path)?.group("VTKHDF")?;
    let numbers: Vec<f64> = root.dataset("Points")?.read_raw()?;
    let (positions, rest) = numbers.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(CloudError::NotTriples { numbers: numbers.len() });
    }
    let level = match root.dataset("PointData/phi") {
        Ok(phi) => Some(phi.read_raw()?),
        Err(_) => None,
    };
    Ok(Cloud { positions: positions.to_vec(), level, normals: None })
}

/// Reads `normal` of the points, if they have it, from a frame or any file that is laid out like one.
///
/// # Errors
/// Whatever libhdf5 reports, and normals that are no triples.
pub fn read_normals(path: &Path) -> Result<Option<Vec<[f64; 3]>>, CloudError> {
    let Ok(normal) = File::open(path)?.dataset("VTKHDF/PointData/normal") else { return Ok(None) };
    let numbers: Vec<f64> = normal.read_raw()?;
    match numbers.as_chunks::<3>() {
        (normals, []) => Ok(Some(normals.to_vec())),
        _ => Err(CloudError::NoNormals { numbers: numbers.len() }),
    }
}

/// Why a file holds no points.
#[derive(Debug, thiserror::Error)]
pub enum CloudError {
    /// HDF5.
    #[error("{0}")]
    Hdf5(#[from] hdf5::Error),
    /// Coordinates.
    #[error("/VTKHDF/Points holds {numbers} numbers, which are no triples")]
    NotTriples {
        /// How many.
        numbers: usize,
    },
    /// Components.
    #[error("/VTKHDF/PointData/normal holds {numbers} numbers, which are no triples")]
    NoNormals {
        /// How many.
        numbers: usize,
    },
}
