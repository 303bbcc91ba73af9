//! VTI files: image data as XML, with numbers as text, in base64, or appended, plain or deflated.

use super::image::{Image, VELOCITY, check_count, check_direction, counts, triples};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use meniscus::geometry::flows::GridNodes;
use roxmltree::{Document, Node, ParsingOptions};
use std::io::Read;

/// Bytes that numbers may be inflated to.
const LARGEST: usize = 1 << 31;

/// Reads the velocities of a file.
///
/// # Errors
/// A sentence that names the element and what is wrong with it.
pub(super) fn read(bytes: &[u8]) -> Result<Image, String> {
    let (head, appended) = split(bytes)?;
    let options = ParsingOptions { allow_dtd: false, nodes_limit: 10_000, ..ParsingOptions::default() };
    let document = Document::parse_with_options(&head, options)
        .map_err(|error| format!("this is neither VTKHDF nor a VTI file that can be read: {error}"))?;
    let root = document.root_element();
    let is_image = root.has_tag_name("VTKFile") && root.attribute("type") == Some("ImageData");
    if !is_image {
        return Err("this is no VTKFile of the type ImageData".to_owned());
    }
    let coding = Coding {
        is_big: root.attribute("byte_order") == Some("BigEndian"),
        head: if root.attribute("header_type") == Some("UInt64") { 8 } else { 4 },
        is_deflated: match root.attribute("compressor") {
            None => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => return Err(format!("the compressor {other} is not read; vtkZLibDataCompressor is")),
        },
        appended,
    };
    let image = child(root, "ImageData")?;
    let pieces: Vec<Node> = image.children().filter(|node| node.has_tag_name("Piece")).collect();
    let [piece] = pieces.as_slice() else {
        return Err(format!("the image has {} pieces; save it as one", pieces.len()));
    };
    let extent = numbers(piece.attribute("Extent").or(image.attribute("WholeExtent")).unwrap_or(""))?;
    let counts = counts(&extent)?;
    check_count(counts, 1)?;
    let triple = |name: &str, otherwise: f64| -> Result<[f64; 3], String> {
        let Some(text) = image.attribute(name) else { return Ok([otherwise; 3]) };
        numbers(text)?.try_into().map_err(|_| format!("{name} of the ImageData is {text:?}, not three numbers"))
    };
    check_direction(image.attribute("Direction").map(numbers).transpose()?.as_deref())?;
    let (origin, spacing) = (triple("Origin", 0.0)?, triple("Spacing", 1.0)?);
    let origin = std::array::from_fn(|d| origin[d] + extent[2 * d] * spacing[d]);
    let data = child(*piece, "PointData")?;
    let arrays: Vec<Node> = data.children().filter(|node| node.has_tag_name("DataArray")).collect();
    let array = arrays.iter().find(|array| array.attribute("Name") == Some(VELOCITY)).ok_or_else(|| {
        let names: Vec<&str> = arrays.iter().filter_map(|array| array.attribute("Name")).collect();
        format!("the PointData have no array {VELOCITY:?}; they have {names:?} (cell data are not read)")
    })?;
    let components: usize = array.attribute("NumberOfComponents").and_then(|n| n.parse().ok()).unwrap_or(1);
    if !matches!(components, 2 | 3) {
        return Err(format!("{VELOCITY:?} has {components} components; a velocity has 2 or 3"));
    }
    let velocity = triples(coding.values(*array)?, components);
    Ok(Image { nodes: GridNodes { counts, origin, spacing, times: vec![0.0] }, velocity })
}

/// The XML without appended numbers, and these where there are some.
fn split(bytes: &[u8]) -> Result<(String, Option<Appended<'_>>), String> {
    let find = |pattern: &[u8], from: usize| {
        bytes[from..].windows(pattern.len()).position(|found| found == pattern).map(|at| from + at)
    };
    let text = |bytes: &[u8]| {
        std::str::from_utf8(bytes)
            .map(str::to_owned)
            .map_err(|_| "this is neither VTKHDF nor VTI: it is no text".to_owned())
    };
    let Some(tag) = find(b"<AppendedData", 0) else { return Ok((text(bytes)?, None)) };
    let end = find(b">", tag).ok_or("the element AppendedData does not end")?;
    let start = find(b"_", end).ok_or("the appended data do not begin with an underscore")? + 1;
    let is_base64 = find(b"base64", tag).is_some_and(|at| at < end);
    let close = find(b"</AppendedData", start).unwrap_or(bytes.len());
    // In base64 the end cannot be among the numbers; raw ones may look like anything.
    let data = if is_base64 { &bytes[start..close] } else { &bytes[start..] };
    Ok((text(&bytes[..tag])? + "</VTKFile>", Some(Appended { data, is_base64 })))
}

struct Appended<'a> {
    data: &'a [u8],
    is_base64: bool,
}

/// How numbers are written.
struct Coding<'a> {
    is_big: bool,
    /// Bytes of a count.
    head: usize,
    is_deflated: bool,
    appended: Option<Appended<'a>>,
}

fn child<'a>(node: Node<'a, 'a>, name: &str) -> Result<Node<'a, 'a>, String> {
    node.children().find(|child| child.has_tag_name(name)).ok_or_else(|| format!("there is no element {name}"))
}

fn numbers(text: &str) -> Result<Vec<f64>, String> {
    text.split_whitespace().map(|word| word.parse().map_err(|_| format!("{word:?} is no number"))).collect()
}

impl Coding<'_> {
    /// The numbers of an array.
    fn values(&self, array: Node) -> Result<Vec<f64>, String> {
        let text = || array.text().unwrap_or_default();
        let bytes = match array.attribute("format") {
            Some("ascii") | None => return numbers(text()),
            Some("binary") => self.decoded(text().as_bytes())?,
            Some("appended") => {
                let appended = self.appended.as_ref().ok_or("there are no appended data")?;
                let offset = array.attribute("offset").and_then(|offset| offset.parse::<usize>().ok());
                let data = offset
                    .and_then(|offset| appended.data.get(offset..))
                    .ok_or("an offset leads beyond the appended data")?;
                if appended.is_base64 { self.decoded(data)? } else { self.whole(data)? }
            }
            Some(other) => return Err(format!("the format {other:?} of numbers is not read")),
        };
        let real = |bytes: &[u8]| -> Option<f64> {
            let mut bytes = bytes.to_vec();
            if self.is_big {
                bytes.reverse();
            }
            match bytes.len() {
                4 => Some(f64::from(f32::from_le_bytes(bytes.try_into().ok()?))),
                _ => Some(f64::from_le_bytes(bytes.try_into().ok()?)),
            }
        };
        let width = match array.attribute("type") {
            Some("Float32") => 4,
            Some("Float64") => 8,
            other => return Err(format!("velocities of the type {other:?} are not read; Float32 and Float64 are")),
        };
        bytes.chunks_exact(width).map(real).collect::<Option<_>>().ok_or_else(|| "the numbers are torn".to_owned())
    }

    fn count(&self, bytes: &[u8], k: usize) -> Option<usize> {
        let from = k.checked_mul(self.head)?;
        let mut count = bytes.get(from..from.checked_add(self.head)?)?.to_vec();
        if self.is_big {
            count.reverse();
        }
        count.resize(8, 0);
        usize::try_from(u64::from_le_bytes(count.try_into().ok()?)).ok()
    }

    /// Bytes in base64, behind counts.
    fn decoded(&self, text: &[u8]) -> Result<Vec<u8>, String> {
        let text: Vec<u8> = text.iter().copied().filter(|byte| !byte.is_ascii_whitespace()).collect();
        let torn = || "numbers in base64 are torn".to_owned();
        let decode = |text: &[u8]| STANDARD.decode(text).map_err(|_| torn());
        let coded = |bytes: usize| bytes.div_ceil(3) * 4;
        let first = coded(self.head);
        if !self.is_deflated {
            let head = text.get(..first).ok_or_else(torn)?;
            let length = self.count(&decode(head)?, 0).filter(|length| *length <= text.len()).ok_or_else(torn)?;
            // The count is coded by itself, and so ends in a sign that fills up, or with the numbers.
            if head.ends_with(b"=") {
                return decode(text.get(first..first + coded(length)).ok_or_else(torn)?);
            }
            let mut whole = decode(text.get(..coded(self.head + length)).ok_or_else(torn)?)?;
            return Ok(whole.split_off(self.head));
        }
        let blocks = self.count(&decode(text.get(..first).ok_or_else(torn)?)?, 0).ok_or_else(torn)?;
        let bytes = blocks.checked_add(3).and_then(|n| n.checked_mul(self.head)).filter(|n| *n <= text.len());
        let signs = coded(bytes.ok_or_else(torn)?);
        let head = decode(text.get(..signs).ok_or_else(torn)?)?;
        let whole = (0..blocks).try_fold(0_usize, |sum, k| sum.checked_add(self.count(&head, 3 + k)?));
        let sizes = whole.filter(|sizes| *sizes <= text.len()).ok_or_else(torn)?;
        let data = decode(text.get(signs..signs + coded(sizes)).ok_or_else(torn)?)?;
        self.inflated(&head, &data)
    }

    /// Plain bytes behind their counts.
    fn whole(&self, data: &[u8]) -> Result<Vec<u8>, String> {
        let torn = || "the appended numbers are torn".to_owned();
        let first = self.count(data, 0).ok_or_else(torn)?;
        if !self.is_deflated {
            let end = first.checked_add(self.head).ok_or_else(torn)?;
            return data.get(self.head..end).map(<[u8]>::to_vec).ok_or_else(torn);
        }
        let bytes = first.checked_add(3).and_then(|n| n.checked_mul(self.head)).ok_or_else(torn)?;
        let (head, data) = data.split_at_checked(bytes).ok_or_else(torn)?;
        self.inflated(head, data)
    }

    /// Inflates blocks: their number, the size of each and of the last, and their deflated sizes stand in the head.
    fn inflated(&self, head: &[u8], data: &[u8]) -> Result<Vec<u8>, String> {
        let torn = || "the deflated numbers are torn".to_owned();
        let blocks = self.count(head, 0).ok_or_else(torn)?;
        let (mut all, mut from) = (Vec::new(), 0_usize);
        for k in 0..blocks {
            let size = self.count(head, 3 + k).ok_or_else(torn)?;
            let end = from.checked_add(size).ok_or_else(torn)?;
            let block = data.get(from..end).ok_or_else(torn)?;
            let most = (LARGEST - all.len()) as u64;
            flate2::read::ZlibDecoder::new(block).take(most).read_to_end(&mut all).map_err(|_| torn())?;
            if all.len() >= LARGEST {
                return Err(format!("the numbers inflate to more than {LARGEST} bytes"));
            }
            from = end;
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::read;

    fn file(head: &str, array: &str, behind: &[u8]) -> Vec<u8> {
        let text = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" {head}>\n<ImageData WholeExtent=\"1 3 0 1 0 0\" \
             Origin=\"0 1 0\" Spacing=\"0.5 2 1\">\n<Piece Extent=\"1 3 0 1 0 0\"><PointData>{array}</PointData></Piece>\
             </ImageData>\n"
        );
        [text.as_bytes(), behind, b"</VTKFile>"].concat()
    }

    #[test]
    fn text_is_read_with_its_nodes() {
        let array = "<DataArray type=\"Float64\" Name=\"velocity\" NumberOfComponents=\"2\" format=\"ascii\">\
                     0 1 2 3 4 5 6 7 8 9 10 11</DataArray>";
        let found = read(&file("byte_order=\"LittleEndian\"", array, b"")).unwrap();
        assert_eq!((found.nodes.counts, found.nodes.origin), ([3, 2, 1], [0.5, 1.0, 0.0]));
        assert_eq!(found.velocity[3..6], [2.0, 3.0, 0.0]);
    }

    #[test]
    fn appended_raw_numbers_may_look_like_anything() {
        let array =
            "<DataArray type=\"Float32\" Name=\"velocity\" NumberOfComponents=\"3\" format=\"appended\" offset=\"2\"/>";
        let numbers: Vec<u8> = (0..18).flat_map(|k| (k as f32).to_be_bytes()).collect();
        let behind =
            [&b"<AppendedData encoding=\"raw\">_xx"[..], &72_u32.to_be_bytes(), &numbers, b"</AppendedData>"].concat();
        let found = read(&file("byte_order=\"BigEndian\" header_type=\"UInt32\"", array, &behind)).unwrap();
        assert_eq!(found.velocity[15..], [15.0, 16.0, 17.0]);
    }

    #[test]
    fn what_is_missing_is_named() {
        let other = "<DataArray type=\"Float64\" Name=\"p\" format=\"ascii\">0</DataArray>";
        assert!(read(&file("", other, b"")).err().unwrap().contains("[\"p\"]"));
        assert!(read(b"<VTKFile type=\"PolyData\"></VTKFile>").err().unwrap().contains("ImageData"));
        assert!(read(b"<VTKFile type=\"ImageData\"><ImageData>").is_err());
        assert!(read(&file("compressor=\"vtkLZ4DataCompressor\"", other, b"")).err().unwrap().contains("ZLib"));
    }
}
