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

/// Reads positions, normals and faces.
pub(super) fn read(text: &str) -> Result<Mesh, String> {
    let mut mesh = Mesh::default();
    let mut normals = Vec::new();
    // The normal that a face gives to a point.
    let mut given: HashMap<u32, usize> = HashMap::new();
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
                check_count(mesh.faces.len() / 4)?;
                let mut face = Vec::new();
                for word in words {
                    if face.len() >= MOST_CORNERS {
                        return Err(format!("line {line} has more than {MOST_CORNERS} corners"));
                    }
                    let mut parts = word.split('/');
                    let point = index(parts.next(), mesh.points.len(), ("point", line))?;
                    let normal = parts.nth(1).filter(|text| !text.is_empty());
                    let normal = normal.map(|text| index(Some(text), normals.len(), ("normal", line))).transpose()?;
                    face.push((point, normal));
                }
                // A face of two corners is a line, and one of one corner a point.
                if face.len() > 2 {
                    given.extend(face.iter().filter_map(|(point, normal)| normal.map(|n| (*point, n as usize))));
                    mesh.faces.push(face.into_iter().map(|(point, _)| point).collect());
                }
            }
            _ => {}
        }
    }
    if !given.is_empty() {
        // Points to which no face gives a normal are refused where all formats are, unless they are no part of the surface.
        let of_point = |k: u32| given.get(&k).and_then(|normal| normals.get(*normal)).copied().unwrap_or([f64::NAN; 3]);
        mesh.normals = (0..mesh.points.len() as u32).map(of_point).collect();
    } else if normals.len() == mesh.points.len() {
        mesh.normals = normals;
    }
    Ok(mesh)
}

/// The first three numbers of a line; a weight or a color may follow.
fn triple(words: &mut SplitWhitespace, line: usize) -> Result<[f64; 3], String> {
    let mut next = || words.next().ok_or_else(|| format!("line {line} has fewer than 3 numbers"));
    Ok([text::real(next()?, line)?, text::real(next()?, line)?, text::real(next()?, line)?])
}

/// An index: from 1, or from the end where negative.
fn index(text: Option<&str>, count: usize, (kind, line): (&str, usize)) -> Result<u32, String> {
    let text = text.unwrap_or_default();
    let number: i64 = text.parse().map_err(|_| format!("line {line}: {text:?} is no index of a {kind}"))?;
    let place = if number < 0 { (count as i64).checked_add(number) } else { number.checked_sub(1) };
    place.and_then(|place| u32::try_from(place).ok()).filter(|place| (*place as usize) < count).ok_or_else(|| {
        format!("line {line}: there is no {kind} {number} among the {count} before it (they are counted from 1)")
    })
}
