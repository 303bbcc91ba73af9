//! Frames as VTKHDF `PolyData` (version 2.0): every particle is a vertex, and triangles of a surface are polygons. ParaView, VTK, PyVista and h5py open them.
//!
//! VTK's reader needs all four topology groups, and numbers only under `FieldData`.

use super::hdf5_file::{create, open, write};
use hdf5::Group;
use hdf5::types::FixedAscii;
use meniscus::simulation::{FieldValues, Fields};
use std::path::Path;

/// Writes the fields of one state; the file is closed when this returns. Where findings are about points, the field `finding`
/// has a bit for each of them, and `FieldData/finding.CODE` says which.
///
/// # Errors
/// Errors of libhdf5.
pub fn write_frame(path: &Path, fields: &Fields, time: f64, step: u64) -> hdf5::Result<()> {
    let file = create(path)?;
    let root = file.create_group("VTKHDF")?;
    root.new_attr::<i64>().shape(2).create("Version")?.write_raw(&[2_i64, 0])?;
    let kind = FixedAscii::<8>::from_ascii(b"PolyData").map_err(|e| hdf5::Error::from(e.to_string()))?;
    root.new_attr::<FixedAscii<8>>().create("Type")?.write_scalar(&kind)?;
    let count = fields.points.len();
    write(&root, "NumberOfPoints", 1, &[count as i64])?;
    write(&root, "Points", 3, fields.points.as_flattened())?;
    let places: Vec<i64> = (0..=count as i64).collect();
    topology(&root, "Vertices", &places, &places[..count])?;
    let corners: Vec<i64> = fields.triangles.as_flattened().iter().map(|corner| i64::from(*corner)).collect();
    let ends: Vec<i64> = (0..=fields.triangles.len() as i64).map(|k| 3 * k).collect();
    topology(&root, "Lines", &[0], &[])?;
    topology(&root, "Polygons", &ends, &corners)?;
    topology(&root, "Strips", &[0], &[])?;
    let data = root.create_group("PointData")?;
    for field in &fields.columns {
        match &field.values {
            FieldValues::Scalar(values) => write(&data, field.name, 1, values)?,
            FieldValues::Vector(values) => write(&data, field.name, 3, values.as_flattened())?,
            FieldValues::Id(values) => write(&data, field.name, 1, values)?,
        };
    }
    let moment = root.create_group("FieldData")?;
    write(&moment, "Time", 1, &[time])?;
    write(&moment, "Step", 1, &[step as i64])?;
    if !fields.marks.is_empty() {
        let mut bits = vec![0_i64; count];
        for (k, mark) in fields.marks.iter().enumerate().take(MOST_MARKS) {
            mark.points.iter().filter(|point| **point < count).for_each(|point| bits[*point] |= 1 << k);
            write(&moment, &format!("finding.{}", mark.code), 1, &[1_i64 << k])?;
        }
        write(&data, "finding", 1, &bits)?;
    }
    file.close()
}

/// Findings that can be told apart in a frame.
const MOST_MARKS: usize = 62;

fn topology(root: &Group, name: &str, offsets: &[i64], connectivity: &[i64]) -> hdf5::Result<()> {
    let group = root.create_group(name)?;
    write(&group, "NumberOfCells", 1, &[offsets.len() as i64 - 1])?;
    write(&group, "NumberOfConnectivityIds", 1, &[connectivity.len() as i64])?;
    write(&group, "Offsets", 1, offsets)?;
    write(&group, "Connectivity", 1, connectivity)?;
    Ok(())
}

/// An open frame.
pub struct Frame {
    root: Group,
}

impl Frame {
    /// Opens a frame.
    ///
    /// # Errors
    /// Errors of libhdf5.
    pub fn open(path: &Path) -> hdf5::Result<Self> {
        Ok(Self { root: open(path)?.group("VTKHDF")? })
    }

    /// Scene time.
    ///
    /// # Errors
    /// Errors of libhdf5.
    pub fn time(&self) -> hdf5::Result<f64> {
        Ok(self.root.dataset("FieldData/Time")?.read_raw::<f64>()?.first().copied().unwrap_or(0.0))
    }

    /// Positions.
    ///
    /// # Errors
    /// Errors of libhdf5.
    pub fn points(&self) -> hdf5::Result<Vec<[f64; 3]>> {
        Ok(triples(&self.root.dataset("Points")?.read_raw()?))
    }

    /// The numbers of a field; None where the frame does not have it.
    ///
    /// # Errors
    /// Errors of libhdf5.
    pub fn scalars(&self, field: &str) -> hdf5::Result<Option<Vec<f64>>> {
        self.root.dataset(&format!("PointData/{field}")).ok().map(|data| data.read_raw()).transpose()
    }

    /// The vectors of a field; None where the frame does not have it.
    ///
    /// # Errors
    /// Errors of libhdf5.
    pub fn vectors(&self, field: &str) -> hdf5::Result<Option<Vec<[f64; 3]>>> {
        Ok(self.scalars(field)?.map(|numbers| triples(&numbers)))
    }
}

fn triples(numbers: &[f64]) -> Vec<[f64; 3]> {
    numbers.as_chunks::<3>().0.to_vec()
}

/// φ and a scalar field of a frame, where it has both.
///
/// # Errors
/// Errors of libhdf5.
pub fn read_profile(path: &Path, field: &str) -> hdf5::Result<Option<Vec<(f64, f64)>>> {
    let frame = Frame::open(path)?;
    let pair = frame.scalars("phi")?.zip(frame.scalars(field)?);
    Ok(pair.map(|(phi, values)| phi.into_iter().zip(values).collect()))
}
