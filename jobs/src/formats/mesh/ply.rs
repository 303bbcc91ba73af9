//! PLY files: a header of text, then the values of its elements as text or as binary numbers.

use super::{MOST_CORNERS, Mesh};
use crate::spec::uploads::MOST_POINTS;

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
    fn from_name(name: &str) -> Option<Self> {
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

/// Columns of a vertex that are read.
const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

/// What the header says of the values behind it.
struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
    /// Bytes of the header.
    length: usize,
}

/// Reads points, normals and faces.
pub(super) fn read(bytes: &[u8]) -> Result<Mesh, String> {
    let Header { encoding, elements, length } = header(bytes)?;
    let mut values = Values { rest: &bytes[length..], encoding };
    let mut mesh = Mesh::default();
    for element in &elements {
        // Rows without properties are all alike, and there may be very many: one stands for them.
        let rows = if element.properties.is_empty() { element.count.min(1) } else { element.count };
        for _ in 0..rows {
            read_row(element, &mut values, &mut mesh)?;
        }
    }
    Ok(mesh)
}

fn header(bytes: &[u8]) -> Result<Header, String> {
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
            ["property", words @ ..] => add_property(text, words, elements.last_mut())?,
            ["end_header"] => break,
            _ => {}
        }
    }
    Ok(Header { encoding: encoding.ok_or("the format is missing")?, elements, length: at })
}

fn add_property(text: &str, words: &[&str], element: Option<&mut Element>) -> Result<(), String> {
    let (list, kind, name) = match words {
        ["list", count, kind, name] => (Some(*count), *kind, *name),
        [kind, name] => (None, *kind, *name),
        _ => return Err(format!("{text:?} is not understood")),
    };
    let scalar = |name: &str| Scalar::from_name(name).ok_or_else(|| format!("{name:?} is no type"));
    let property = Property { name: name.to_owned(), scalar: scalar(kind)?, list: list.map(scalar).transpose()? };
    let element = element.ok_or_else(|| format!("{text:?} belongs to no element"))?;
    if element.properties.len() >= 64 {
        return Err("an element has more than 64 properties".to_owned());
    }
    element.properties.push(property);
    Ok(())
}

/// Reads one row of an element: a vertex, a face, or something that is ignored.
fn read_row(element: &Element, values: &mut Values, mesh: &mut Mesh) -> Result<(), String> {
    let mut row = [f64::NAN; COLUMNS.len()];
    for property in &element.properties {
        let Some(count) = property.list else {
            let value = values.next(property.scalar)?;
            if let Some(place) = COLUMNS.iter().position(|name| *name == property.name) {
                row[place] = value;
            }
            continue;
        };
        let count = values.next(count)?;
        if !(0.0..=MOST_CORNERS as f64).contains(&count) {
            return Err(format!("a list of {count} entries"));
        }
        let list = (0..count as u64).map(|_| values.next(property.scalar)).collect::<Result<Vec<f64>, String>>()?;
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
    Ok(())
}

struct Values<'a> {
    rest: &'a [u8],
    encoding: Encoding,
}

impl Values<'_> {
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
