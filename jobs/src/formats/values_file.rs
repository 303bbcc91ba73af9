//! Values in the order of the points of a surface, from outside: text with a number a line or in columns (CSV), arrays of NumPy
//! (`.npy`), and the values at the points of a PLY or VTKHDF file.

use super::cloud_file::MOST_VALUES;
use super::mesh::{self, text};
use super::{file_bytes, vtkhdf_points};
use crate::spec::uploads::{ColumnContents, ValueContents};
use meniscus::scene::{Cloud, Column};
use std::fs::File;

/// Columns of a text at most.
const MOST_COLUMNS: usize = 64;
/// Name of values without one.
const NAME: &str = "value";
/// The first bytes of an array of NumPy.
const NUMPY: &[u8] = b"\x93NUMPY";

/// Reads values, and says what was found.
///
/// # Errors
/// A sentence: what is wrong, where, and what helps.
pub fn read(file: &mut File) -> Result<(ValueContents, Cloud), String> {
    let columns =
        if file_bytes::is_hdf5(file)? { vtkhdf_points::columns(file)? } else { columns_of(&file_bytes::all(file)?)? };
    if columns.iter().all(|column| column.values.is_empty()) {
        return Err("there are no values in the file".to_owned());
    }
    let contents = ValueContents {
        values: columns.first().map_or(0, |column| column.values.len() as u64),
        columns: columns.iter().map(contents).collect(),
    };
    Ok((contents, Cloud { columns, ..Cloud::default() }))
}

fn columns_of(bytes: &[u8]) -> Result<Vec<Column>, String> {
    if bytes.starts_with(NUMPY) {
        return numpy(bytes);
    }
    if bytes.starts_with(b"ply") {
        return Ok(mesh::read(bytes)?.columns);
    }
    of_text(&text::decode(bytes.strip_prefix(text::MARK).unwrap_or(bytes))?)
}

fn contents(column: &Column) -> ColumnContents {
    let finite = column.values.iter().copied().filter(|value| value.is_finite());
    let (least, greatest) =
        finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)));
    let is_there = least <= greatest;
    ColumnContents {
        name: column.name.clone(),
        least: is_there.then_some(least),
        greatest: is_there.then_some(greatest),
    }
}

/// The words of a line: between commas, semicolons and blanks.
fn words(line: &str) -> Vec<&str> {
    let trimmed = line.trim();
    let by_signs = trimmed.contains([',', ';', '\t']);
    if by_signs {
        trimmed.split([',', ';', '\t']).map(|word| word.trim().trim_matches('"')).collect()
    } else {
        trimmed.split_whitespace().collect()
    }
}

/// Columns of a text. A first line that is no number names them; lines that begin with # are passed over.
fn of_text(text: &str) -> Result<Vec<Column>, String> {
    let lines = text::lines(text).filter(|(_, line)| !line.trim().is_empty() && !line.trim_start().starts_with('#'));
    let mut columns: Vec<Column> = Vec::new();
    let mut count = 0;
    for (number, line) in lines {
        let words = words(line);
        if columns.is_empty() {
            if words.len() > MOST_COLUMNS {
                return Err(format!("line {number} has {} columns; at most {MOST_COLUMNS} are read", words.len()));
            }
            let is_header = words.iter().all(|word| word.parse::<f64>().is_err());
            columns = names(&words, is_header).into_iter().map(|name| Column { name, values: Vec::new() }).collect();
            if is_header {
                continue;
            }
        }
        if words.len() != columns.len() {
            let (found, expected) = (words.len(), columns.len());
            return Err(format!("line {number} has {found} values, the lines before have {expected}"));
        }
        count += words.len() as u64;
        if count > MOST_VALUES {
            return Err(format!("there are more than {MOST_VALUES} values, the most that are read"));
        }
        for (column, word) in columns.iter_mut().zip(words) {
            column.values.push(text::real(word, number)?);
        }
    }
    Ok(columns)
}

fn names(words: &[&str], is_header: bool) -> Vec<String> {
    match words.len() {
        _ if is_header => words.iter().map(|word| (*word).to_owned()).collect(),
        1 => vec![NAME.to_owned()],
        count => (0..count).map(|k| format!("{NAME}_{k}")).collect(),
    }
}

/// The values of an array of NumPy (format 1 to 3): one axis, or two of which the second counts columns.
fn numpy(bytes: &[u8]) -> Result<Vec<Column>, String> {
    let torn = || "the header of the .npy file is torn".to_owned();
    let version = *bytes.get(6).ok_or_else(torn)?;
    let (start, length) = match version {
        1 => (10, bytes.get(8..10).map(|b| u64::from(u16::from_le_bytes([b[0], b[1]])))),
        2 | 3 => (12, bytes.get(8..12).map(|b| u64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])))),
        _ => return Err(format!("version {version} of the .npy format is not read; versions 1 to 3 are")),
    };
    let end = usize::try_from(length.ok_or_else(torn)?).ok().and_then(|length| length.checked_add(start));
    let end = end.filter(|end| *end <= bytes.len()).ok_or_else(torn)?;
    let head = String::from_utf8_lossy(&bytes[start..end]);
    let entry = |name: &str| head.split_once(&format!("'{name}':")).map(|(_, rest)| rest.trim_start());
    let kind = entry("descr").and_then(|rest| rest.strip_prefix('\'')).and_then(|rest| rest.split('\'').next());
    let kind = kind.ok_or("the .npy file has no plain type of numbers; save numbers, not records")?;
    let by_columns = entry("fortran_order").is_some_and(|rest| rest.starts_with("True"));
    let shape = entry("shape").and_then(|rest| rest.strip_prefix('(')).and_then(|rest| rest.split(')').next());
    let shape: Option<Vec<u64>> = shape
        .map(|shape| shape.split(',').map(str::trim).filter(|n| !n.is_empty()).collect())
        .and_then(|axes: Vec<&str>| axes.into_iter().map(|axis| axis.parse().ok()).collect());
    let (rows, count) = match shape.ok_or_else(torn)?.as_slice() {
        [rows] => (*rows, 1),
        [rows, count] if *count <= MOST_COLUMNS as u64 => (*rows, *count),
        shape => return Err(format!("the array has the shape {shape:?}; values have [n], or [n, columns]")),
    };
    let values = numbers(kind, &bytes[end..])?;
    if rows.checked_mul(count) != Some(values.len() as u64) || values.len() as u64 > MOST_VALUES {
        return Err(format!("the array has {} numbers for a shape of {rows} × {count}", values.len()));
    }
    let (rows, count) = (rows as usize, count as usize);
    let at = |row: usize, column: usize| values[if by_columns { column * rows + row } else { row * count + column }];
    let named = names(&vec![""; count], false).into_iter().enumerate();
    Ok(named.map(|(k, name)| Column { name, values: (0..rows).map(|row| at(row, k)).collect() }).collect())
}

/// Numbers of a type as NumPy names it.
fn numbers(kind: &str, bytes: &[u8]) -> Result<Vec<f64>, String> {
    fn all<const N: usize>(bytes: &[u8], is_big: bool, number: fn([u8; N]) -> f64) -> Vec<f64> {
        let of = |chunk: &[u8; N]| {
            let mut chunk = *chunk;
            if is_big {
                chunk.reverse();
            }
            number(chunk)
        };
        bytes.as_chunks::<N>().0.iter().map(of).collect()
    }
    let is_big = kind.starts_with('>');
    Ok(match kind.trim_start_matches(['<', '>', '|', '=']) {
        "f8" => all(bytes, is_big, f64::from_le_bytes),
        "f4" => all(bytes, is_big, |b| f64::from(f32::from_le_bytes(b))),
        "i8" => all(bytes, is_big, |b| i64::from_le_bytes(b) as f64),
        "i4" => all(bytes, is_big, |b| f64::from(i32::from_le_bytes(b))),
        "u4" => all(bytes, is_big, |b| f64::from(u32::from_le_bytes(b))),
        "u1" | "b1" => bytes.iter().map(|byte| f64::from(*byte)).collect(),
        _ => return Err(format!("numbers of the type {kind:?} are not read; save float64 (astype(float))")),
    })
}

#[cfg(test)]
mod tests {
    use super::columns_of;

    fn columns(bytes: &[u8]) -> Vec<(String, Vec<f64>)> {
        columns_of(bytes).unwrap().into_iter().map(|column| (column.name, column.values)).collect()
    }

    fn numpy(kind: &str, shape: &str, order: &str, numbers: &[u8]) -> Vec<u8> {
        let head = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((head.len() as u16).to_le_bytes());
        bytes.extend(head.as_bytes());
        bytes.extend(numbers);
        bytes
    }

    #[test]
    fn lines_and_tables_are_read_with_their_names() {
        assert_eq!(columns(b"# heat\n1\n2.5\r\n-3e-1\n"), [("value".to_owned(), vec![1.0, 2.5, -0.3])]);
        let named = [("u".to_owned(), vec![1.0, 3.0]), ("v w".to_owned(), vec![2.0, 4.0])];
        assert_eq!(columns(b"u;\"v w\"\n1;2\n\n3;4\n"), named);
        assert_eq!(columns(b"1 2\n3 4\n")[1], ("value_1".to_owned(), vec![2.0, 4.0]));
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        assert!(columns_of(b"1\n2 3\n").unwrap_err().contains("line 2 has 2 values"));
        assert!(columns_of(b"1\n2\nx\n").unwrap_err().contains("line 3: \"x\" is no number"));
        assert!(columns_of(&numpy("<c16", "(1,)", "False", &[0; 16])).unwrap_err().contains("astype(float)"));
        assert!(columns_of(&numpy("<f8", "(3,)", "False", &[0; 16])).unwrap_err().contains("2 numbers"));
        assert!(columns_of(&numpy("<f8", "(1, 1, 1)", "False", &[0; 8])).unwrap_err().contains("shape"));
        for cut in 6..40 {
            let bytes = numpy("<f8", "(1,)", "False", &[0; 8]);
            assert!(columns_of(&bytes[..cut]).is_err(), "{cut}");
        }
    }

    #[test]
    fn arrays_of_numpy_are_read_in_either_order() {
        let floats: Vec<u8> = [1.0, 2.0, 3.0, 4.0_f64].iter().flat_map(|x| x.to_le_bytes()).collect();
        assert_eq!(columns(&numpy("<f8", "(4,)", "False", &floats)), [("value".to_owned(), vec![1.0, 2.0, 3.0, 4.0])]);
        assert_eq!(columns(&numpy("<f8", "(2, 2)", "False", &floats))[1].1, [2.0, 4.0]);
        assert_eq!(columns(&numpy("<f8", "(2, 2)", "True", &floats))[1].1, [3.0, 4.0]);
        let big: Vec<u8> = [7_i32, -2].iter().flat_map(|x| x.to_be_bytes()).collect();
        assert_eq!(columns(&numpy(">i4", "(2,)", "False", &big))[0].1, [7.0, -2.0]);
    }
}
