//! STL files, binary and text: triangles by the positions of their corners. Corners at exactly the same place are one point.
//! Normals of triangles and colors are passed over, and triangles without an area after that are left out.

use super::{Mesh, check_count, text};
use std::collections::HashMap;

/// Bytes before the triangles: a header of 80, and their number.
const HEAD: usize = 84;
/// Bytes of a triangle: a normal, three corners, two bytes of attributes.
const TRIANGLE: usize = 50;
/// Bytes of a normal.
const NORMAL: usize = 12;

/// Whether bytes are triangles in binary: their number fits the length. Binary files may begin with `solid`, too.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    let fits = count(bytes).and_then(|count| count.checked_mul(TRIANGLE)).and_then(|size| size.checked_add(HEAD));
    // Zeros are in no text. What begins with a name that is known is none, either.
    let looks_binary = || bytes.iter().take(HEAD).any(|byte| *byte == 0) && bytes.len() >= HEAD;
    let is_known =
        || super::foreign::format(bytes).is_some() || bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF");
    fits == Some(bytes.len()) || (looks_binary() && !is_known())
}

fn count(bytes: &[u8]) -> Option<usize> {
    bytes.get(80..HEAD).map(|count| u32::from_le_bytes(count.try_into().unwrap_or_default()) as usize)
}

/// Whether a text is one of triangles.
pub(super) fn is_text(text: &str) -> bool {
    let start = text.trim_start();
    start.get(..5).is_some_and(|word| word.eq_ignore_ascii_case("solid"))
}

/// Reads triangles in binary.
pub(super) fn binary(bytes: &[u8]) -> Result<Mesh, String> {
    let count = count(bytes).unwrap_or(0);
    let wanted = HEAD as u64 + TRIANGLE as u64 * count as u64;
    if wanted > bytes.len() as u64 {
        let length = bytes.len();
        return Err(format!(
            "this looks like a binary STL file of {count} triangles, which takes {wanted} bytes, but the file has {length}; it \
             was cut off, or it is none"
        ));
    }
    let mut welded = Welded::default();
    for (k, triangle) in bytes[HEAD..wanted as usize].chunks_exact(TRIANGLE).enumerate() {
        let numbers: Vec<f64> = triangle[NORMAL..TRIANGLE - 2]
            .as_chunks::<4>()
            .0
            .iter()
            .map(|bytes| f64::from(f32::from_le_bytes(*bytes)))
            .collect();
        welded.add(numbers.as_chunks::<3>().0, &format!("triangle {k} (counted from 0)"))?;
    }
    welded.finish()
}

/// Reads triangles in text.
pub(super) fn text(text: &str) -> Result<Mesh, String> {
    let mut welded = Welded::default();
    let (mut corners, mut is_ended) = (Vec::new(), true);
    for (line, words) in text::lines(text) {
        let mut words = words.split_whitespace();
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("vertex") => {
                let numbers = words.map(|word| text::real(word, line)).collect::<Result<Vec<f64>, _>>()?;
                let [x, y, z] = numbers.as_slice() else {
                    return Err(format!("line {line}: a vertex of {} numbers, not 3", numbers.len()));
                };
                corners.push([*x, *y, *z]);
            }
            Some("endfacet") => {
                welded.add(&corners, &format!("the triangle that ends in line {line}"))?;
                corners.clear();
            }
            Some("solid") => is_ended = false,
            Some("endsolid") => is_ended = true,
            _ => {}
        }
    }
    if !corners.is_empty() || !is_ended {
        return Err("the text ends within a solid: the file was cut off (there is no last line endsolid)".to_owned());
    }
    welded.finish()
}

/// Triangles with their corners joined.
#[derive(Default)]
struct Welded {
    mesh: Mesh,
    places: HashMap<[u64; 3], u32>,
}

impl Welded {
    fn add(&mut self, corners: &[[f64; 3]], name: &str) -> Result<(), String> {
        if corners.len() != 3 {
            return Err(format!("{name} has {} corners, not 3", corners.len()));
        }
        check_count(self.mesh.faces.len() / 4)?;
        let mut face = Vec::new();
        for x in corners {
            if x.iter().any(|c| !c.is_finite()) {
                return Err(format!("a corner of {name} is not finite: {} {} {}", x[0], x[1], x[2]));
            }
            // −0 and 0 are one place.
            let key = x.map(|c| (c + 0.0).to_bits());
            let next = self.mesh.points.len() as u32;
            let place = *self.places.entry(key).or_insert(next);
            if place == next {
                check_count(self.mesh.points.len())?;
                self.mesh.points.push(*x);
            }
            face.push(place);
        }
        if face[0] != face[1] && face[1] != face[2] && face[0] != face[2] {
            self.mesh.faces.push(face);
        }
        Ok(())
    }

    fn finish(self) -> Result<Mesh, String> {
        if self.mesh.faces.is_empty() {
            return Err("the STL file has no triangles with an area".to_owned());
        }
        Ok(self.mesh)
    }
}
