//! OBJ files: positions, normals, faces. Groups, materials, texture coordinates, lines and curves are passed over.

use super::{MOST_CORNERS, Mesh, check_count, text};
use std::borrow::Cow;
use std::collections::HashMap;
use std::str::SplitWhitespace;

/// Whether a text has lines of positions.
pub(super) fn is_obj(text: &str) -> bool {
    text::lines(text).map(|(_, line)| line.trim_start()).any(|line| line.starts_with("v ") || line.starts_with("v\t"))
}

/// Lines of which those that end in a backslash go on in the next one.
fn whole_lines(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = text::lines(text);
    std::iter::from_fn(move || {
        let (number, line) = lines.next()?;
        let mut whole = Cow::from(line);
        while let Some(start) = whole.trim_end().strip_suffix('\\') {
            let next = lines.next().map_or("", |(_, line)| line);
            whole = Cow::from(format!("{start} {next}"));
        }
        Some((number, whole))
    })
}

/// Corners of a face with their normals, both from 0, and the line that names them.
struct Face {
    line: usize,
    corners: Vec<(u32, Option<u32>)>,
}

/// Reads positions, normals and faces.
pub(super) fn read(text: &str) -> Result<Mesh, String> {
    let mut mesh = Mesh::default();
    let (mut normals, mut faces) = (Vec::new(), Vec::new());
    for (line, words) in whole_lines(text) {
        let mut words = words.split('#').next().unwrap_or_default().split_whitespace();
        match words.next().unwrap_or_default() {
            "v" => {
                check_count(mesh.points.len())?;
                mesh.points.push(triple(&mut words, line)?);
            }
            "vn" => {
                check_count(normals.len() / 8)?;
                normals.push(triple(&mut words, line)?);
            }
            "f" => {
                check_count(faces.len() / 4)?;
                let corners = corners(words, (mesh.points.len(), normals.len()), line)?;
                // A face of two corners is a line, and one of one corner a point.
                if corners.len() > 2 {
                    faces.push(Face { line, corners });
                }
            }
            _ => {}
        }
    }
    // A face may come before its points. The last face of a point gives it its normal.
    let mut given: HashMap<u32, [f64; 3]> = HashMap::new();
    for Face { line, corners } in faces {
        for (point, normal) in &corners {
            check_index(*point, mesh.points.len(), ("point", line))?;
            if let Some(normal) = normal {
                check_index(*normal, normals.len(), ("normal", line))?;
                given.insert(*point, normals[*normal as usize]);
            }
        }
        mesh.faces.push(corners.into_iter().map(|(point, _)| point).collect());
    }
    if !given.is_empty() {
        // Points to which no face gives a normal are refused where all formats are, unless they are no part of the surface.
        let of_point = |k: u32| given.get(&k).copied().unwrap_or([f64::NAN; 3]);
        mesh.normals = (0..mesh.points.len() as u32).map(of_point).collect();
    } else if normals.len() == mesh.points.len() {
        mesh.normals = normals;
    }
    Ok(mesh)
}

/// Corners of a face: point, texture coordinate and normal of each, of which the latter may be missing.
fn corners(
    words: SplitWhitespace,
    (points, normals): (usize, usize),
    line: usize,
) -> Result<Vec<(u32, Option<u32>)>, String> {
    let mut found = Vec::new();
    for word in words {
        if found.len() >= MOST_CORNERS {
            return Err(format!("line {line} has more than {MOST_CORNERS} corners"));
        }
        let mut parts = word.split('/');
        let point = index(parts.next().unwrap_or_default(), points, ("point", line))?;
        let normal = parts.nth(1).filter(|text| !text.is_empty());
        let normal = normal.map(|text| index(text, normals, ("normal", line))).transpose()?;
        found.push((point, normal));
    }
    Ok(found)
}

/// The first three numbers of a line; a weight or a color may follow.
fn triple(words: &mut SplitWhitespace, line: usize) -> Result<[f64; 3], String> {
    let mut next = || words.next().ok_or_else(|| format!("line {line} has fewer than 3 numbers"));
    Ok([text::real(next()?, line)?, text::real(next()?, line)?, text::real(next()?, line)?])
}

/// An index, as one from 0: it is from 1, or from the end of what came before where it is negative.
fn index(text: &str, count: usize, (kind, line): (&str, usize)) -> Result<u32, String> {
    let number: i64 = text.parse().map_err(|_| format!("line {line}: {text:?} is no index of a {kind}"))?;
    let place = if number < 0 { (count as i64).checked_add(number) } else { number.checked_sub(1) };
    place.and_then(|place| u32::try_from(place).ok()).ok_or_else(|| {
        format!(
            "line {line}: there is no {kind} {number}; there are {count} before it, counted from 1, or from −1 backward"
        )
    })
}

fn check_index(place: u32, count: usize, (kind, line): (&str, usize)) -> Result<(), String> {
    if (place as usize) < count {
        return Ok(());
    }
    Err(format!("line {line}: there is no {kind} {} among {count} (they are counted from 1)", u64::from(place) + 1))
}
