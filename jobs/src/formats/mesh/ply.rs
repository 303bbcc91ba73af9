//! PLY files: a header of text, then the values of its elements as text or as binary numbers. Vertices, faces and triangle
//! strips are read; other elements, properties and comments are passed over.

use super::{MOST_CORNERS, Mesh, strip_faces, text};
use crate::formats::cloud_file::MOST_VALUES;
use crate::spec::uploads::MOST_POINTS;
use meniscus::scene::Column;

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

    fn width(self) -> usize {
        let (Self::Int(width) | Self::Unsigned(width) | Self::Float(width)) = self;
        width
    }
}

struct Property {
    name: String,
    scalar: Scalar,
    /// The type of the count, of lists.
    list: Option<Scalar>,
}

impl Property {
    /// Whether it lists the corners of a face or a strip.
    fn is_corners(&self) -> bool {
        self.list.is_some() && self.name.starts_with("vert")
    }
}

/// What the rows of an element are.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Vertex,
    Face,
    Strip,
    Other,
}

struct Element {
    name: String,
    kind: Kind,
    count: u64,
    properties: Vec<Property>,
}

/// Columns of a vertex that are read.
const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
/// Bytes of the header and of one of its lines, elements, and properties of one of them at most.
const LARGEST_HEADER: usize = 1 << 20;
const LONGEST_LINE: usize = 1 << 14;
const MOST_ELEMENTS: usize = 256;
const MOST_PROPERTIES: usize = 4096;
/// Further columns of the vertices that are read at most.
const MOST_COLUMNS: usize = 64;
/// Numbers of all rows of corners at most.
const MOST_ROWS: u64 = 4 * MOST_POINTS;

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
    let mut mesh = Mesh { columns: further_columns(&elements), ..Mesh::default() };
    let is_wanted = |element: &Element| element.kind != Kind::Other;
    // What follows the last element that is read need not be there.
    let last = elements.iter().rposition(is_wanted).map_or(0, |last| last + 1);
    for element in &elements[..last] {
        // Rows without properties are all alike, and there may be very many: one stands for them.
        let rows = if element.properties.is_empty() { element.count.min(1) } else { element.count };
        for row in 0..rows {
            read_row(element, &mut values, &mut mesh)
                .map_err(|what| format!("{} {row} (counted from 0) of {}: {what}", element.name, element.count))?;
        }
    }
    Ok(mesh)
}

/// Scalars of the vertices beside places and normals, as columns without values.
fn further_columns(elements: &[Element]) -> Vec<Column> {
    let Some(vertices) = elements.iter().find(|element| element.kind == Kind::Vertex) else { return Vec::new() };
    let is_further = |property: &&Property| property.list.is_none() && !COLUMNS.contains(&property.name.as_str());
    let found = vertices.properties.iter().filter(is_further);
    let most = MOST_COLUMNS.min((MOST_VALUES / vertices.count.max(1)) as usize);
    found.take(most).map(|property| Column { name: property.name.clone(), values: Vec::new() }).collect()
}

/// The lines of a header end in LF, CR LF or CR, all as the first one does.
fn header(bytes: &[u8]) -> Result<Header, String> {
    let first_end = bytes.iter().position(|byte| matches!(byte, b'\n' | b'\r')).ok_or("the PLY header does not end")?;
    let end: &[u8] = match bytes.get(first_end..first_end + 2) {
        Some(b"\r\n") => b"\r\n",
        _ if bytes[first_end] == b'\r' => b"\r",
        _ => b"\n",
    };
    let mut at = first_end + end.len();
    let mut line = || -> Result<String, String> {
        let rest = bytes.get(at..).unwrap_or_default();
        let window = &rest[..rest.len().min(LONGEST_LINE)];
        let length = window.windows(end.len()).position(|found| found == end);
        let length = length
            .filter(|_| at < LARGEST_HEADER)
            .ok_or("the PLY header does not end (there is no line end_header)")?;
        at += length + end.len();
        // Comments may be in any encoding.
        Ok(String::from_utf8_lossy(&rest[..length]).trim().to_owned())
    };
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let text = line()?;
        let words: Vec<&str> = text.split_whitespace().collect();
        match words.as_slice() {
            ["format", "ascii", ..] => encoding = Some(Encoding::Text),
            ["format", "binary_little_endian", ..] => encoding = Some(Encoding::Little),
            ["format", "binary_big_endian", ..] => encoding = Some(Encoding::Big),
            ["element", name, count, ..] => elements.push(element(&text, name, count, elements.len())?),
            ["property", words @ ..] => add_property(&text, words, elements.last_mut())?,
            ["end_header"] => break,
            _ => {}
        }
    }
    let encoding = encoding.ok_or("the PLY header has no line \"format\"")?;
    elements.iter().try_for_each(check_element)?;
    if elements.iter().all(|element| element.kind != Kind::Vertex) {
        return Err("the PLY header has no element \"vertex\"".to_owned());
    }
    Ok(Header { encoding, elements, length: at })
}

fn element(text: &str, name: &str, count: &str, before: usize) -> Result<Element, String> {
    let count: u64 = count.parse().map_err(|_| format!("the header line {text:?} has no count"))?;
    let kind = match name {
        "vertex" => Kind::Vertex,
        "face" => Kind::Face,
        "tristrips" | "tristrip" => Kind::Strip,
        _ => Kind::Other,
    };
    let most = if kind == Kind::Vertex { MOST_POINTS } else { MOST_ROWS };
    if kind != Kind::Other && count > most {
        return Err(format!("the header line {text:?}: at most {most} are read"));
    }
    if before >= MOST_ELEMENTS {
        return Err(format!("the header has more than {MOST_ELEMENTS} elements"));
    }
    Ok(Element { name: name.to_owned(), kind, count, properties: Vec::new() })
}

fn add_property(text: &str, words: &[&str], element: Option<&mut Element>) -> Result<(), String> {
    let (list, kind, name) = match words {
        ["list", count, kind, name, ..] => (Some(*count), *kind, *name),
        [kind, name, ..] => (None, *kind, *name),
        _ => return Err(format!("the header line {text:?} is not understood")),
    };
    let scalar = |name: &str| {
        Scalar::from_name(name).ok_or_else(|| format!("the header line {text:?}: {name:?} is no type of numbers"))
    };
    let property = Property { name: name.to_owned(), scalar: scalar(kind)?, list: list.map(scalar).transpose()? };
    let element = element.ok_or_else(|| format!("the header line {text:?} belongs to no element"))?;
    if element.properties.len() >= MOST_PROPERTIES {
        return Err(format!("the element {:?} has more than {MOST_PROPERTIES} properties", element.name));
    }
    element.properties.push(property);
    Ok(())
}

/// Refuses vertices that lack a coordinate or a part of a normal.
fn check_element(element: &Element) -> Result<(), String> {
    if element.kind != Kind::Vertex || element.count == 0 {
        return Ok(());
    }
    let has = |name: &str| element.properties.iter().any(|property| property.name == name && property.list.is_none());
    if let Some(missing) = ["x", "y"].into_iter().find(|name| !has(name)) {
        return Err(format!("the vertices have no property {missing:?}"));
    }
    let normal = COLUMNS[3..].iter().filter(|name| has(name)).count();
    if normal != 0 && normal != 3 {
        return Err("the vertices have some of the properties nx, ny, nz, but not all three".to_owned());
    }
    Ok(())
}

/// Reads one row of an element: a vertex, a face, a strip, or something that is passed over.
fn read_row(element: &Element, values: &mut Values, mesh: &mut Mesh) -> Result<(), String> {
    // Points of the plane have no z.
    let mut row = [0.0; COLUMNS.len()];
    let mut further = mesh.columns.len();
    for property in &element.properties {
        let Some(count) = property.list else {
            let place = COLUMNS.iter().position(|name| element.kind == Kind::Vertex && *name == property.name);
            match place {
                Some(place) => row[place] = values.next(property.scalar)?,
                None if element.kind == Kind::Vertex && further > 0 => {
                    let column = mesh.columns.len() - further;
                    mesh.columns[column].values.push(values.next(property.scalar)?);
                    further -= 1;
                }
                None => values.skip(property.scalar, 1)?,
            }
            continue;
        };
        let count = values.next(count)?;
        if count < 0.0 || count.fract() != 0.0 {
            return Err(format!("a list of {count} entries"));
        }
        let count = count as u64;
        match element.kind {
            Kind::Face if property.is_corners() => {
                if count > MOST_CORNERS as u64 {
                    return Err(format!("a face of {count} corners; at most {MOST_CORNERS} are read"));
                }
                let corners = (0..count).map(|_| values.next(property.scalar).and_then(corner));
                let corners = corners.collect::<Result<Vec<u32>, String>>()?;
                // Two corners are a line.
                if corners.len() > 2 {
                    mesh.faces.push(corners);
                }
            }
            Kind::Strip if property.is_corners() => read_strips(count, property.scalar, values, mesh)?,
            _ => values.skip(property.scalar, count)?,
        }
    }
    if element.kind == Kind::Vertex {
        mesh.points.push([row[0], row[1], row[2]]);
        if element.properties.iter().any(|property| property.name == "nx") {
            mesh.normals.push([row[3], row[4], row[5]]);
        }
    }
    Ok(())
}

/// Reads strips of triangles in one list: −1 ends one, which is the largest number of a type without sign.
fn read_strips(count: u64, scalar: Scalar, values: &mut Values, mesh: &mut Mesh) -> Result<(), String> {
    let mut strip = Vec::new();
    for _ in 0..count {
        let value = values.next(scalar)?;
        if value == -1.0 || value == f64::from(u32::MAX) {
            strip_faces(&strip, &mut mesh.faces);
            strip.clear();
        } else {
            strip.push(corner(value)?);
        }
    }
    strip_faces(&strip, &mut mesh.faces);
    if mesh.faces.len() as u64 > MOST_ROWS {
        return Err(format!("more than {MOST_ROWS} triangles; no more are read"));
    }
    Ok(())
}

/// An index of a point.
fn corner(value: f64) -> Result<u32, String> {
    let is_index = value.fract() == 0.0 && (0.0..f64::from(u32::MAX)).contains(&value);
    if is_index { Ok(value as u32) } else { Err(format!("{value} is no index of a vertex")) }
}

struct Values<'a> {
    rest: &'a [u8],
    encoding: Encoding,
}

const TOO_SOON: &str = "the file ends too soon: it was cut off, or its header counts too many";

impl Values<'_> {
    /// Passes over values.
    fn skip(&mut self, scalar: Scalar, count: u64) -> Result<(), String> {
        if self.encoding == Encoding::Text {
            return (0..count).try_for_each(|_| self.word().map(|_| ()));
        }
        let bytes = usize::try_from(count).ok().and_then(|count| count.checked_mul(scalar.width()));
        self.rest = bytes.and_then(|bytes| self.rest.get(bytes..)).ok_or(TOO_SOON)?;
        Ok(())
    }

    /// The next word of a text.
    fn word(&mut self) -> Result<&[u8], String> {
        let start = self.rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or(TOO_SOON)?;
        let rest = &self.rest[start..];
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.rest = &rest[end..];
        Ok(&rest[..end])
    }

    fn next(&mut self, scalar: Scalar) -> Result<f64, String> {
        if self.encoding == Encoding::Text {
            let word = String::from_utf8_lossy(self.word()?).into_owned();
            return word.parse().map_err(|_| text::no_number(&word));
        }
        let width = scalar.width();
        let bytes = self.rest.get(..width).ok_or(TOO_SOON)?;
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
