//! Attributes in the headers of groups: a few numbers with a name. Attributes of other kinds, and those in tables of their own, are
//! passed over: nothing depends on them.

use super::element::Element;
use super::header::Message;
use super::{Bytes, Reader, numbers};

/// Numbers of an attribute at most.
const MOST_NUMBERS: u64 = 64;

impl<B: Bytes + ?Sized> Reader<'_, B> {
    /// Name and numbers of an attribute message; None where it has something else.
    pub(super) fn attribute(&self, message: &Message) -> Option<(String, Vec<f64>)> {
        let mut cursor = numbers(&message.data);
        let version = cursor.number(1)?;
        // Marks of shared types, of which there are none before version 2.
        let marks = cursor.number(1)?;
        if !(1..=3).contains(&version) || version > 1 && marks != 0 {
            return None;
        }
        let sizes = [cursor.number(2)?, cursor.number(2)?, cursor.number(2)?];
        if version == 3 {
            cursor.skip(1)?;
        }
        let mut part = |size: u64| {
            let from = cursor.at;
            cursor.skip(size as usize)?;
            let found = message.data.get(from..cursor.at)?;
            if version == 1 {
                cursor.skip(size.wrapping_neg() as usize % 8)?;
            }
            Some(found)
        };
        let (name, kind, space) = (part(sizes[0])?, part(sizes[1])?, part(sizes[2])?);
        let (element, width) = Element::from_message(kind)?;
        let name = std::str::from_utf8(name).ok()?.trim_end_matches('\0').to_owned();
        let space = Message { kind: 1, flags: 0, at: message.at, data: space.to_vec() };
        let count = self.extent("", &space).ok()?.0.iter().fold(1_u64, |product, n| product.saturating_mul(*n));
        let bytes = message.data.get(cursor.at..)?;
        let is_whole = count <= MOST_NUMBERS && width > 0 && bytes.len() as u64 >= count * width;
        let values = bytes.chunks_exact(width.max(1) as usize).take(count as usize).map(|bytes| element.real(bytes));
        is_whole.then(|| values.collect::<Option<Vec<f64>>>()).flatten().map(|values| (name, values))
    }
}
