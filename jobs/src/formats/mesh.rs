//! Surfaces in common formats: PLY (text and binary), OBJ, STL (text and binary), XYZ. Positions, normals and faces are read;
//! everything else is passed over. Text may have a byte order mark (UTF-8 or UTF-16), and lines may end in LF, CR LF or CR.

mod foreign;
mod obj;
mod ply;
mod stl;
pub(super) mod text;
mod xyz;

use crate::spec::uploads::MOST_POINTS;
use meniscus::scene::Column;
use std::collections::HashMap;

/// Points, normals where every point has one, triangles or polygons by their points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Positions of the points.
    pub points: Vec<[f64; 3]>,
    /// Normals, as many as points or none. A normal that is missing is NaN.
    pub normals: Vec<[f64; 3]>,
    /// Corners of each face, as indices of points.
    pub faces: Vec<Vec<u32>>,
    /// Whether points belong to the surface though no face has them.
    pub has_loose_points: bool,
    /// Further values at the points.
    pub columns: Vec<Column>,
    /// Index in the file of each point, where some were left out; else empty.
    pub kept: Vec<u32>,
}

/// Most corners of a face.
const MOST_CORNERS: usize = 1 << 16;
/// Share of the points without a face beyond which a file is neither a mesh nor points.
const MOST_LOOSE: f64 = 0.5;
/// What helps where normals are wrong.
const WITHOUT_NORMALS: &str = "write them anew, or leave normals out: then they are estimated";

/// Reads a mesh; its format is guessed from the bytes.
///
/// # Errors
/// A sentence that names the line or the byte.
pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    let bytes = bytes.strip_prefix(text::MARK).unwrap_or(bytes);
    let mesh = if let Some(rest) = bytes.strip_prefix(b"ply")
        && rest.first().is_none_or(u8::is_ascii_whitespace)
    {
        ply::read(bytes)?
    } else if stl::is_binary(bytes) {
        stl::binary(bytes)?
    } else {
        let text = text::decode(bytes)?;
        if text.starts_with("ply") {
            ply::read(text.as_bytes())?
        } else if stl::is_text(&text) {
            stl::text(&text)?
        } else if obj::is_obj(&text) {
            obj::read(&text)?
        } else {
            xyz::read(&text)?
        }
    };
    if mesh.points.is_empty() { Err("there are no points in the file".to_owned()) } else { Ok(mesh) }
}

impl Mesh {
    /// Leaves out points that no face has, where there are faces: they are no part of the surface. Returns their number.
    ///
    /// # Errors
    /// Where more than half of the points would be left out.
    pub fn leave_out_loose_points(&mut self) -> Result<u64, String> {
        if self.faces.is_empty() || self.has_loose_points {
            return Ok(0);
        }
        let mut places = vec![None; self.points.len()];
        for corner in self.faces.iter().flatten() {
            if let Some(place) = places.get_mut(*corner as usize) {
                *place = Some(0);
            }
        }
        let mut kept = 0;
        places.iter_mut().flatten().for_each(|place| {
            *place = kept;
            kept += 1;
        });
        let (all, left_out) = (self.points.len(), self.points.len() - kept as usize);
        if left_out as f64 > MOST_LOOSE * all as f64 {
            return Err(format!(
                "{left_out} of {all} points belong to no face; send the points without faces, or faces that cover the surface"
            ));
        }
        if left_out > 0 {
            let is_kept = |k: usize| places.get(k).is_some_and(Option::is_some);
            let keep = |list: &[[f64; 3]]| (0..).zip(list).filter(|(k, _)| is_kept(*k)).map(|(_, x)| *x).collect();
            (self.points, self.normals) = (keep(&self.points), keep(&self.normals));
            self.kept = (0..all as u32).filter(|k| is_kept(*k as usize)).collect();
            for column in &mut self.columns {
                let values = std::mem::take(&mut column.values).into_iter().enumerate();
                column.values = values.filter(|(k, _)| is_kept(*k)).map(|(_, value)| value).collect();
            }
            for corner in self.faces.iter_mut().flatten() {
                *corner = places.get(*corner as usize).copied().flatten().unwrap_or(u32::MAX);
            }
        }
        Ok(left_out as u64)
    }

    /// Refuses what is no surface: numbers that are not finite, normals that are missing or have no length, faces of points
    /// that are not there.
    ///
    /// # Errors
    /// A sentence that names the first point or face, how many there are, and what helps.
    pub fn check(&self) -> Result<(), String> {
        let count = self.points.len();
        let is_wrong = |x: &[f64; 3]| x.iter().any(|c| !c.is_finite());
        let list = |found: &[usize]| format!("point {} (counted from 0){}", found[0], and_more(found.len() - 1));
        let wrong: Vec<usize> = (0..count).filter(|k| is_wrong(&self.points[*k])).collect();
        if !wrong.is_empty() {
            let [x, y, z] = self.points[wrong[0]];
            return Err(format!("the position of {} is not finite: {x} {y} {z}; take such points out", list(&wrong)));
        }
        if !self.normals.is_empty() && self.normals.len() != count {
            return Err(format!("{} of {count} points have normals; {WITHOUT_NORMALS}", self.normals.len()));
        }
        let wrong: Vec<usize> = (0..self.normals.len()).filter(|k| is_wrong(&self.normals[*k])).collect();
        if !wrong.is_empty() {
            let [x, y, z] = self.normals[wrong[0]];
            return Err(format!("the normal of {} is not finite: {x} {y} {z}; {WITHOUT_NORMALS}", list(&wrong)));
        }
        let wrong: Vec<usize> = (0..self.normals.len()).filter(|k| self.normals[*k] == [0.0; 3]).collect();
        if !wrong.is_empty() {
            return Err(format!("the normal of {} is zero, which is no direction; {WITHOUT_NORMALS}", list(&wrong)));
        }
        let is_bad = |face: &Vec<u32>| face.len() < 3 || face.iter().any(|v| *v as usize >= count);
        if let Some(k) = self.faces.iter().position(is_bad) {
            return Err(format!(
                "face {k} (counted from 0) has fewer than 3 corners or names a point that is not there"
            ));
        }
        Ok(())
    }

    /// Its faces as triangles that share their first corners.
    #[must_use]
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let of = |face: &Vec<u32>| {
            let first = face.first().copied().unwrap_or(0);
            let pairs = face.get(1..).unwrap_or_default().windows(2);
            pairs.map(move |pair| [first, pair[0], pair[1]]).collect::<Vec<_>>()
        };
        self.faces.iter().flat_map(of).collect()
    }

    /// Whether every edge belongs to exactly two faces that run along it in opposite directions.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        let mut edges: HashMap<(u32, u32), (u32, u32)> = HashMap::new();
        for face in &self.faces {
            for (k, a) in face.iter().enumerate() {
                let b = face[(k + 1) % face.len()];
                let entry = edges.entry((*a.min(&b), *a.max(&b))).or_default();
                if *a < b { entry.0 += 1 } else { entry.1 += 1 }
            }
        }
        !edges.is_empty() && edges.values().all(|uses| *uses == (1, 1))
    }
}

/// Adds the triangles of a strip: each corner from the third on makes one with the two before it, and every second is turned.
/// Triangles with two equal corners join parts of a strip and are none.
pub(super) fn strip_faces(strip: &[u32], faces: &mut Vec<Vec<u32>>) {
    for (k, corners) in strip.windows(3).enumerate() {
        let [a, b, c] = [corners[0], corners[1], corners[2]];
        if a != b && b != c && a != c {
            faces.push(if k % 2 == 0 { vec![a, b, c] } else { vec![b, a, c] });
        }
    }
}

fn and_more(more: usize) -> String {
    if more > 0 { format!(" and of {more} more") } else { String::new() }
}

fn check_count(count: usize) -> Result<(), String> {
    if count as u64 >= MOST_POINTS {
        return Err(format!("there are more than {MOST_POINTS} points or faces, the most that are read"));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
