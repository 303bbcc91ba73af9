//! Text of files from outside: encodings, lines and numbers.

use super::foreign;

/// The byte order mark of UTF-8.
pub(in crate::formats) const MARK: &[u8] = b"\xEF\xBB\xBF";

/// The text of a file. Bytes that are no UTF-8 can only be in comments and names, which are not read.
pub(in crate::formats) fn decode(bytes: &[u8]) -> Result<String, String> {
    if let Some(name) = foreign::format(bytes) {
        return Err(format!("this is {name}, which is not read; save it as PLY, OBJ, STL, XYZ or VTKHDF"));
    }
    let utf_16 = |bytes: &[u8], unit: fn([u8; 2]) -> u16| -> String {
        let units = bytes.as_chunks::<2>().0.iter().map(|pair| unit(*pair));
        char::decode_utf16(units).map(|found| found.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
    };
    if let Some(rest) = bytes.strip_prefix(b"\xFF\xFE") {
        return Ok(utf_16(rest, u16::from_le_bytes));
    }
    if let Some(rest) = bytes.strip_prefix(b"\xFE\xFF") {
        return Ok(utf_16(rest, u16::from_be_bytes));
    }
    if let Some(at) = bytes.iter().position(|byte| *byte == 0) {
        let what = "this is neither text nor a format that is known: PLY, OBJ, STL, XYZ and VTKHDF are read";
        return Err(format!("{what} (byte {at} is 0)"));
    }
    Ok(String::from_utf8_lossy(bytes).into_owned())
}

/// Lines with their numbers from 1. They end in LF or CR LF, or in CR where the text has no LF.
pub(in crate::formats) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    (1..).zip(text.split(end).map(|line| line.trim_end_matches('\r')))
}

/// A number of a line.
pub(in crate::formats) fn real(word: &str, line: usize) -> Result<f64, String> {
    word.parse().map_err(|_| format!("line {line}: {}", no_number(word)))
}

/// Why a word is no number.
pub(in crate::formats) fn no_number(word: &str) -> String {
    let short: String = word.chars().take(40).collect();
    if has_decimal_comma(word) {
        return format!(
            "{short:?} has a decimal comma; numbers are read with a decimal point ({})",
            short.replace(',', ".")
        );
    }
    format!("{short:?} is no number")
}

/// Whether a comma stands between two digits.
pub(in crate::formats) fn has_decimal_comma(word: &str) -> bool {
    word.as_bytes().windows(3).any(|bytes| bytes[1] == b',' && bytes[0].is_ascii_digit() && bytes[2].is_ascii_digit())
}
