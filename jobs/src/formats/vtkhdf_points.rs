//! Points from VTKHDF files of others: positions, level, normals and faces, by our own reading of HDF5 ([`structure`]).
//!
//! VTK's own writer, ParaView and h5py write such files in several formats; numbers may have 32 or 64 bits in either byte
//! order. Normals are called `normal` as in frames, or `Normals` as by VTK's filters. Files of several pieces are read as one,
//! files of several time steps are refused.

use super::cloud_file::MOST_VALUES;
use super::mesh::{Mesh, strip_faces};
use super::structure::{self, DataSet, Refusal, Structure};
use crate::spec::uploads::{MOST_POINTS, Purpose};
use meniscus::scene::Column;
use std::fs::File;

/// Corners of all faces at most.
const MOST_CORNERS: u64 = 16 * MOST_POINTS;
/// Names of normals.
const NORMALS: [&str; 2] = ["normal", "Normals"];
/// The group of point data.
const POINT_DATA: &str = "/VTKHDF/PointData";

/// What a file has.
#[derive(Debug, Clone, PartialEq)]
pub struct VtkPoints {
    /// Positions, normals and faces, of a surface; places alone otherwise.
    pub mesh: Mesh,
    /// φ of each point.
    pub level: Option<Vec<f64>>,
}

/// Reads the points of a file for a purpose.
///
/// # Errors
/// A sentence that names the data set and what is wrong with it.
pub fn read(file: &File, purpose: Purpose) -> Result<VtkPoints, String> {
    let structure = structure::read(file).map_err(|refusal| match refusal {
        Refusal::NotHdf5 if purpose == Purpose::Points => {
            format!("{refusal}; points with their level (phi) come as VTKHDF")
        }
        _ => refusal.to_string(),
    })?;
    let found = Found { file, structure };
    let (points, count) = found.check_points()?;
    let level = found.level(purpose, count)?;
    let normals = if purpose == Purpose::Surface { found.normals(count)? } else { None };
    let mut mesh = Mesh { points: found.triples(points)?, ..Mesh::default() };
    if let Some(normals) = normals {
        mesh.normals = found.triples(&normals)?;
    }
    if purpose == Purpose::Surface {
        mesh.columns = found.columns(count)?;
    }
    if matches!(purpose, Purpose::Surface | Purpose::Mesh) {
        (mesh.faces, mesh.has_loose_points) = found.faces(count)?;
    }
    let level = level.map(|place| found.reals(place)).transpose()?;
    Ok(VtkPoints { mesh, level })
}

/// Reads the values at the points of a file.
///
/// # Errors
/// A sentence that names the data set and what is wrong with it.
pub fn columns(file: &File) -> Result<Vec<Column>, String> {
    let structure = structure::read(file).map_err(|refusal| refusal.to_string())?;
    let found = Found { file, structure };
    let (_, count) = found.check_points()?;
    found.columns(count)
}

/// An open file and its structure.
struct Found<'a> {
    file: &'a File,
    structure: Structure,
}

impl Found<'_> {
    fn get(&self, place: &str) -> Option<&DataSet> {
        self.structure.data_sets.get(place)
    }

    fn reals(&self, place: &str) -> Result<Vec<f64>, String> {
        let data_set = self.get(place).ok_or_else(|| format!("there is no data set {place}"))?;
        structure::reals(self.file, place, data_set).map_err(|refusal: Refusal| refusal.to_string())
    }

    fn triples(&self, place: &str) -> Result<Vec<[f64; 3]>, String> {
        Ok(self.reals(place)?.as_chunks::<3>().0.to_vec())
    }

    /// Whole numbers, at most so many; none where there is no such data set.
    fn integers(&self, place: &str, most: u64) -> Result<Vec<i64>, String> {
        let Some(data_set) = self.get(place) else { return Ok(Vec::new()) };
        if data_set.elements() > most {
            return Err(format!("{place} has {} numbers; at most {most} are read", data_set.elements()));
        }
        structure::integers(self.file, place, data_set).map_err(|refusal| refusal.to_string())
    }

    /// The place of the positions and their number.
    fn check_points(&self) -> Result<(&'static str, u64), String> {
        let place = "/VTKHDF/Points";
        let points = self.get(place).ok_or(
            "there is no data set /VTKHDF/Points (points come as VTKHDF of the type PolyData; ParaView saves it as .vtkhdf)",
        )?;
        let [count, 3] = *points.extent.as_slice() else {
            return Err(format!("{place} has the extent {:?}, not [n, 3]", points.extent));
        };
        if !points.is_float() || count == 0 || count > MOST_POINTS {
            return Err(format!(
                "{place} must be 1 to {MOST_POINTS} points of floating-point numbers of 32 or 64 bits"
            ));
        }
        let steps = self.get("/VTKHDF/Steps/Values").map_or(1, DataSet::elements);
        if steps > 1 {
            return Err(format!("the file has {steps} time steps in /VTKHDF/Steps; save one of them by itself"));
        }
        Ok((place, count))
    }

    fn level(&self, purpose: Purpose, count: u64) -> Result<Option<&'static str>, String> {
        let place = "/VTKHDF/PointData/phi";
        match self.get(place) {
            // Places are asked about: what they may have beside does not matter.
            _ if purpose != Purpose::Points => Ok(None),
            Some(phi) if !phi.is_float() || ![vec![count], vec![count, 1]].contains(&phi.extent) => Err(format!(
                "{place} must be {count} floating-point numbers of 32 or 64 bits; its extent is {:?}",
                phi.extent
            )),
            Some(_) => Ok(Some(place)),
            None => Err("there is no data set /VTKHDF/PointData/phi (the level, positive outside)".to_owned()),
        }
    }

    /// The place of the normals.
    fn normals(&self, count: u64) -> Result<Option<String>, String> {
        let places = NORMALS.map(|name| format!("{POINT_DATA}/{name}"));
        let Some(place) = places.into_iter().find(|place| self.get(place).is_some()) else { return Ok(None) };
        match self.get(&place) {
            Some(normal) if !normal.is_float() || normal.extent != [count, 3] => {
                let found = &normal.extent;
                Err(format!(
                    "{place} must be [{count}, 3] floating-point numbers of 32 or 64 bits; its extent is {found:?}"
                ))
            }
            _ => Ok(Some(place)),
        }
    }

    /// Scalars at the points, and the components of vectors; normals are none.
    fn columns(&self, count: u64) -> Result<Vec<Column>, String> {
        let mut columns = Vec::new();
        let mut numbers = 0;
        for (place, data_set) in &self.structure.data_sets {
            let Some(name) = place.strip_prefix(POINT_DATA).and_then(|rest| rest.strip_prefix('/')) else { continue };
            let components = match data_set.extent.as_slice() {
                [n] | [n, 1] if *n == count => 1,
                [n, 3] if *n == count => 3,
                _ => continue,
            };
            numbers += components * count;
            if NORMALS.contains(&name) || !data_set.is_number() || numbers > MOST_VALUES {
                continue;
            }
            let values = self.reals(place)?;
            if components == 1 {
                columns.push(Column { name: name.to_owned(), values });
            } else {
                columns.extend(["x", "y", "z"].into_iter().enumerate().map(|(d, axis)| Column {
                    name: format!("{name}_{axis}"),
                    values: values.iter().skip(d).step_by(3).copied().collect(),
                }));
            }
        }
        Ok(columns)
    }

    /// Polygons and strips, and whether points belong to the surface without a face: those that are vertices, or all where
    /// there are no faces.
    fn faces(&self, count: u64) -> Result<(Vec<Vec<u32>>, bool), String> {
        let pieces = self.integers("/VTKHDF/NumberOfPoints", count)?;
        let mut faces = self.cells("Polygons", &pieces, count)?;
        for strip in self.cells("Strips", &pieces, count)? {
            strip_faces(&strip, &mut faces);
        }
        faces.retain(|face| face.len() > 2);
        let has_vertices = self.get("/VTKHDF/Vertices/Connectivity").is_some_and(|corners| corners.elements() > 0);
        Ok((faces, has_vertices))
    }

    /// Corners of the cells of a kind, piece after piece: each has offsets of its own, and its corners count from its first
    /// point.
    fn cells(&self, kind: &str, pieces: &[i64], count: u64) -> Result<Vec<Vec<u32>>, String> {
        let place = |name: &str| format!("/VTKHDF/{kind}/{name}");
        let corners = self.integers(&place("Connectivity"), MOST_CORNERS)?;
        if corners.is_empty() {
            return Ok(Vec::new());
        }
        let offsets = self.integers(&place("Offsets"), MOST_CORNERS)?;
        let cells_of = self.integers(&place("NumberOfCells"), count)?;
        let wrong = |what: &str| format!("{} and {}: {what}", place("Offsets"), place("Connectivity"));
        let (mut found, mut next, mut from, mut first) = (Vec::new(), 0, 0, 0);
        let whole = [offsets.len() as i64 - 1];
        let cells_of = if cells_of.is_empty() { whole.as_slice() } else { cells_of.as_slice() };
        for (piece, cells) in cells_of.iter().enumerate() {
            let cells = usize::try_from(*cells).map_err(|_| wrong("a count of cells is negative"))?;
            let end = cells.checked_add(next + 1).ok_or_else(|| wrong("there are too many cells"))?;
            let ends = offsets.get(next..end).ok_or_else(|| wrong("there are fewer offsets than cells"))?;
            let here: &[i64] = corners.get(from..).unwrap_or_default();
            for pair in ends.windows(2) {
                let range = usize::try_from(pair[0]).ok().zip(usize::try_from(pair[1]).ok());
                let face = range.and_then(|(from, to)| here.get(from..to));
                let face = face.ok_or_else(|| wrong("an offset leads beyond the corners"))?;
                let corner = |corner: &i64| {
                    let point =
                        corner.checked_add(first).filter(|_| *corner >= 0).and_then(|point| u32::try_from(point).ok());
                    point.filter(|point| u64::from(*point) < count)
                };
                let face = face.iter().map(corner).collect::<Option<Vec<u32>>>();
                found.push(face.ok_or_else(|| wrong(&format!("a corner names a point that is not among {count}")))?);
            }
            next = end;
            from += usize::try_from(ends.last().copied().unwrap_or(0)).unwrap_or(0);
            first = first.saturating_add(pieces.get(piece).copied().unwrap_or(0));
        }
        Ok(found)
    }
}
