//! Surfaces in common text and binary formats: PLY (text and binary), OBJ, XYZ. Only positions, normals and faces are
//! read; everything else is ignored.

mod ply;

use crate::spec::uploads::MOST_POINTS;
use std::collections::HashMap;

/// Points, normals where every point has one, triangles or polygons by their points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Positions of the points.
    pub points: Vec<[f64; 3]>,
    /// Normals, as many as points or none.
    pub normals: Vec<[f64; 3]>,
    /// Corners of each face, as indices of points.
    pub faces: Vec<Vec<u32>>,
}

/// Most corners of a face.
const MOST_CORNERS: u64 = 1000;

/// Reads a mesh; its format is guessed from the bytes.
///
/// # Errors
/// A sentence that names the line or the byte.
pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    let mesh = if bytes.starts_with(b"ply") {
        ply::read(bytes)?
    } else {
        let text = std::str::from_utf8(bytes).map_err(|e| format!("byte {} is no text", e.valid_up_to()))?;
        let is_obj = text.lines().map(str::trim_start).any(|l| l.starts_with("v ") || l.starts_with("v\t"));
        if is_obj { obj(text)? } else { xyz(text)? }
    };
    if mesh.points.is_empty() {
        return Err("there are no points".to_owned());
    }
    if !mesh.normals.is_empty() && mesh.normals.len() != mesh.points.len() {
        return Err(format!("{} of {} points have normals", mesh.normals.len(), mesh.points.len()));
    }
    if let Some(k) = mesh.points.iter().chain(&mesh.normals).position(|p| p.iter().any(|c| !c.is_finite())) {
        return Err(format!("coordinate {} is not finite", k % mesh.points.len()));
    }
    let count = mesh.points.len();
    if let Some(k) = mesh.faces.iter().position(|face| face.len() < 3 || face.iter().any(|v| *v as usize >= count)) {
        return Err(format!("face {k} has fewer than 3 corners or names a point that is not there"));
    }
    Ok(mesh)
}

impl Mesh {
    /// Its faces as triangles that share their first corners.
    #[must_use]
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let of = |face: &Vec<u32>| {
            let first = face[0];
            face[1..].windows(2).map(move |pair| [first, pair[0], pair[1]]).collect::<Vec<_>>()
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

fn real(word: &str, line: usize) -> Result<f64, String> {
    word.parse().map_err(|_| format!("line {}: {:?} is no number", line + 1, word.chars().take(40).collect::<String>()))
}

fn check_count(count: usize) -> Result<(), String> {
    if count as u64 >= MOST_POINTS { Err(format!("there are more than {MOST_POINTS} points or faces")) } else { Ok(()) }
}

fn xyz(text: &str) -> Result<Mesh, String> {
    let mut mesh = Mesh::default();
    for (k, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let words = line.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty());
        let numbers = words.map(|word| real(word, k)).collect::<Result<Vec<f64>, _>>()?;
        check_count(mesh.points.len())?;
        match numbers.as_slice() {
            [x, y] => mesh.points.push([*x, *y, 0.0]),
            [x, y, z] => mesh.points.push([*x, *y, *z]),
            [x, y, z, nx, ny, nz] => {
                mesh.points.push([*x, *y, *z]);
                mesh.normals.push([*nx, *ny, *nz]);
            }
            other => return Err(format!("line {} has {} numbers; 2, 3 or 6 are understood", k + 1, other.len())),
        }
    }
    Ok(mesh)
}

fn obj(text: &str) -> Result<Mesh, String> {
    let mut mesh = Mesh::default();
    let mut normals = Vec::new();
    // The normal that a face gives to a point.
    let mut given: HashMap<u32, usize> = HashMap::new();
    for (k, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        let kind = words.next().unwrap_or_default();
        let triple = |words: &mut std::str::SplitWhitespace| -> Result<[f64; 3], String> {
            let mut next = || words.next().ok_or_else(|| format!("line {} has fewer than 3 numbers", k + 1));
            Ok([real(next()?, k)?, real(next()?, k)?, real(next()?, k)?])
        };
        match kind {
            "v" => {
                check_count(mesh.points.len())?;
                mesh.points.push(triple(&mut words)?);
            }
            "vn" => {
                check_count(normals.len())?;
                normals.push(triple(&mut words)?);
            }
            "f" => {
                check_count(mesh.faces.len())?;
                let mut face = Vec::new();
                for word in words {
                    if face.len() as u64 >= MOST_CORNERS {
                        return Err(format!("line {} has more than {MOST_CORNERS} corners", k + 1));
                    }
                    let mut parts = word.split('/');
                    let point = index(parts.next(), mesh.points.len(), k)?;
                    if let Some(normal) = parts.nth(1).filter(|text| !text.is_empty()) {
                        given.insert(point, index(Some(normal), normals.len(), k)? as usize);
                    }
                    face.push(point);
                }
                mesh.faces.push(face);
            }
            _ => {}
        }
    }
    if !given.is_empty() {
        // Those that faces give to some points only are refused where all formats are.
        let of_point = |k: u32| given.get(&k).and_then(|normal| normals.get(*normal)).copied();
        mesh.normals = (0..mesh.points.len() as u32).filter_map(of_point).collect();
    } else if normals.len() == mesh.points.len() {
        mesh.normals = normals;
    }
    Ok(mesh)
}

/// An index of an OBJ file: from 1, or from the end where negative.
fn index(text: Option<&str>, count: usize, line: usize) -> Result<u32, String> {
    let text = text.unwrap_or_default();
    let number: i64 = text.parse().map_err(|_| format!("line {}: {text:?} is no index", line + 1))?;
    let place = if number < 0 { count as i64 + number } else { number - 1 };
    u32::try_from(place)
        .ok()
        .filter(|place| (*place as usize) < count)
        .ok_or_else(|| format!("line {}: there is no number {number} among {count}", line + 1))
}

#[cfg(test)]
mod tests {
    use super::read;

    const TETRAHEDRON: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";

    #[test]
    fn the_same_tetrahedron_in_every_format() {
        let text = read(TETRAHEDRON.as_bytes()).unwrap();
        assert_eq!((text.points.len(), text.faces.len(), text.is_closed()), (4, 4, true));
        for (name, big) in [("binary_little_endian", false), ("binary_big_endian", true)] {
            let mut bytes = TETRAHEDRON.split("end_header\n").next().unwrap().replace("ascii", name).into_bytes();
            bytes.extend(b"end_header\n");
            for c in text.points.iter().flatten() {
                let c = *c as f32;
                bytes.extend(if big { c.to_be_bytes() } else { c.to_le_bytes() });
            }
            for face in &text.faces {
                bytes.push(3);
                for v in face {
                    bytes.extend(if big { v.to_be_bytes() } else { v.to_le_bytes() });
                }
            }
            assert_eq!(read(&bytes).unwrap(), text);
            assert!(read(&bytes[..bytes.len() - 1]).is_err());
        }
        let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 1 0 0\nf 1//1 3//1 2//1\nf 1//1 2//1 4//1\nf -4//1 -1//1 3//1\nf 2 3 4\n";
        let obj = read(obj.as_bytes()).unwrap();
        assert_eq!((obj.points.as_slice(), obj.normals.len(), obj.is_closed()), (text.points.as_slice(), 4, true));
        let points = read(b"# points\n0 0 0\n1,0,0\n0 1 0\n0 0 1\n").unwrap();
        assert_eq!((points.points, points.faces.len()), (text.points, 0));
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, part) in [
            ("0 0\n1 2 3 4\n", "line 2"),
            ("0 0 x\n", "no number"),
            ("nan 0 0\n", "not finite"),
            ("v 0 0 0\nf 1 2 3\n", "line 2"),
            ("", "no points"),
            ("0 0 0\n1 0 0 0 0 1\n", "1 of 2 points have normals"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3\n", "2 of 3 points have normals"),
            (
                "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\nproperty int nx\n\
                 property int ny\nproperty int nz\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\n\
                 end_header\n0 0 0 1 0 0\n1 0 0\n",
                "1 of 2 points have normals",
            ),
            ("ply\nformat ascii 1.0\nelement vertex 99999999999\nend_header\n", "at most"),
            ("ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n1\n", "too soon"),
        ] {
            let message = read(text.as_bytes()).unwrap_err();
            assert!(message.contains(part), "{text:?}: {message}");
        }
    }
}
