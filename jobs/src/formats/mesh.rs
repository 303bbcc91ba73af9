//! Surfaces in common text and binary formats: PLY (text and binary), OBJ, XYZ. Only positions, normals and faces are
//! taken; everything else is passed over.

use crate::spec::uploads::MOST_POINTS;
use std::collections::HashMap;

/// Points, normals where every point has one, triangles or polygons by their points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Positions.
    pub points: Vec<[f64; 3]>,
    /// Normals, as many as points or none.
    pub normals: Vec<[f64; 3]>,
    /// Faces.
    pub faces: Vec<Vec<u32>>,
}

/// Corners of a face at most.
const MOST_CORNERS: u64 = 1000;

/// Reads a mesh by what the bytes look like.
///
/// # Errors
/// A sentence that names the line or the byte.
pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    let mesh = if bytes.starts_with(b"ply") {
        ply(bytes)?
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

fn room(count: usize) -> Result<(), String> {
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
        room(mesh.points.len())?;
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
                room(mesh.points.len())?;
                mesh.points.push(triple(&mut words)?);
            }
            "vn" => {
                room(normals.len())?;
                normals.push(triple(&mut words)?);
            }
            "f" => {
                room(mesh.faces.len())?;
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

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Text,
    Little,
    Big,
}

#[derive(Clone, Copy)]
enum Scalar {
    Int(usize),
    Unsigned(usize),
    Float(usize),
}

impl Scalar {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::Int(1),
            "uchar" | "uint8" => Self::Unsigned(1),
            "short" | "int16" => Self::Int(2),
            "ushort" | "uint16" => Self::Unsigned(2),
            "int" | "int32" => Self::Int(4),
            "uint" | "uint32" => Self::Unsigned(4),
            "float" | "float32" => Self::Float(4),
            "double" | "float64" => Self::Float(8),
            _ => return None,
        })
    }
}

struct Property {
    name: String,
    scalar: Scalar,
    /// The type of the count, of lists.
    list: Option<Scalar>,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

fn ply(bytes: &[u8]) -> Result<Mesh, String> {
    let mut at = 0;
    let mut line = || -> Result<&str, String> {
        let rest = bytes.get(at..).unwrap_or_default();
        let end = rest.iter().take(1 << 12).position(|b| *b == b'\n').ok_or("the header does not end")?;
        at += end + 1;
        std::str::from_utf8(&rest[..end]).map(str::trim).map_err(|_| "the header is no text".to_owned())
    };
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    line()?;
    loop {
        let text = line()?;
        let words: Vec<&str> = text.split_whitespace().collect();
        match words.as_slice() {
            ["format", "ascii", ..] => encoding = Some(Encoding::Text),
            ["format", "binary_little_endian", ..] => encoding = Some(Encoding::Little),
            ["format", "binary_big_endian", ..] => encoding = Some(Encoding::Big),
            ["element", name, count] => {
                let count: u64 = count.parse().map_err(|_| format!("{text:?} has no count"))?;
                if count > MOST_POINTS || elements.len() > 16 {
                    return Err(format!("{text:?}: at most {MOST_POINTS} are understood, of 16 kinds"));
                }
                elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
            }
            ["property", rest @ ..] => {
                let (list, kind, name) = match rest {
                    ["list", count, kind, name] => (Some(*count), *kind, *name),
                    [kind, name] => (None, *kind, *name),
                    _ => return Err(format!("{text:?} is not understood")),
                };
                let scalar = |name: &str| Scalar::of(name).ok_or_else(|| format!("{name:?} is no type"));
                let property =
                    Property { name: name.to_owned(), scalar: scalar(kind)?, list: list.map(scalar).transpose()? };
                let element = elements.last_mut().ok_or_else(|| format!("{text:?} belongs to no element"))?;
                if element.properties.len() >= 64 {
                    return Err("an element has more than 64 properties".to_owned());
                }
                element.properties.push(property);
            }
            ["end_header"] => break,
            _ => {}
        }
    }
    let encoding = encoding.ok_or("the format is missing")?;
    let mut values = PlyValues { rest: &bytes[at..], encoding };
    let mut mesh = Mesh::default();
    for element in &elements {
        for _ in 0..element.count {
            let mut row = [f64::NAN; 6];
            for property in &element.properties {
                let place = ["x", "y", "z", "nx", "ny", "nz"].iter().position(|name| *name == property.name);
                let Some(count) = property.list else {
                    let value = values.next(property.scalar)?;
                    if let Some(place) = place {
                        row[place] = value;
                    }
                    continue;
                };
                let count = values.next(count)?;
                if !(0.0..=MOST_CORNERS as f64).contains(&count) {
                    return Err(format!("a list of {count} entries"));
                }
                let list =
                    (0..count as u64).map(|_| values.next(property.scalar)).collect::<Result<Vec<f64>, String>>()?;
                if element.name == "face" && property.name.starts_with("vert") {
                    mesh.faces.push(list.iter().map(|v| *v as u32).collect());
                }
            }
            if element.name == "vertex" {
                mesh.points.push([row[0], row[1], row[2]]);
                if element.properties.iter().any(|p| p.name == "nx") {
                    mesh.normals.push([row[3], row[4], row[5]]);
                }
            }
            if element.properties.is_empty() {
                break;
            }
        }
    }
    Ok(mesh)
}

struct PlyValues<'a> {
    rest: &'a [u8],
    encoding: Encoding,
}

impl PlyValues<'_> {
    fn next(&mut self, scalar: Scalar) -> Result<f64, String> {
        if self.encoding == Encoding::Text {
            let start = self.rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or("the data end too soon")?;
            let rest = &self.rest[start..];
            let end = rest.iter().take(64).position(u8::is_ascii_whitespace).unwrap_or(rest.len().min(64));
            self.rest = &rest[end..];
            let word = std::str::from_utf8(&rest[..end]).unwrap_or_default();
            return word.parse().map_err(|_| format!("{word:?} is no number"));
        }
        let (Scalar::Int(width) | Scalar::Unsigned(width) | Scalar::Float(width)) = scalar;
        let bytes = self.rest.get(..width).ok_or("the data end too soon")?;
        self.rest = &self.rest[width..];
        let mut raw = [0; 8];
        raw[..width].copy_from_slice(bytes);
        if self.encoding == Encoding::Big {
            raw[..width].reverse();
        }
        let number = u64::from_le_bytes(raw);
        Ok(match scalar {
            Scalar::Unsigned(_) => number as f64,
            Scalar::Int(width) => ((number << (64 - 8 * width)).cast_signed() >> (64 - 8 * width)) as f64,
            Scalar::Float(4) => f64::from(f32::from_bits(number as u32)),
            Scalar::Float(_) => f64::from_bits(number),
        })
    }
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
