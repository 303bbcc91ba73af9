//! What data sets say of themselves: extent, type, layout, filters.

use super::{Bytes, DataSet, FILTERS, LARGEST_BLOCK, LARGEST_DATA, Message, Reader, Refusal, UNDEFINED, numbers};

impl<B: Bytes + ?Sized> Reader<'_, B> {
    pub(super) fn filters(&self, place: &str, message: &Message) -> Result<(), Refusal> {
        let torn = || self.damaged(place, message.at, "the filter pipeline is torn");
        let mut cursor = numbers(&message.data);
        let version = cursor.number(1).ok_or_else(torn)?;
        let count = cursor.number(1).ok_or_else(torn)?;
        if version == 1 {
            cursor.skip(6).ok_or_else(torn)?;
        }
        for _ in 0..count {
            let id = cursor.number(2).ok_or_else(torn)? as u16;
            if !FILTERS.contains(&id) {
                let what = format!("filter {id} (accepted are deflate, shuffle and Fletcher-32)");
                return Err(self.unaccepted(place, what));
            }
            let name = if version == 1 { cursor.number(2).ok_or_else(torn)? as usize } else { 0 };
            cursor.skip(2).ok_or_else(torn)?;
            let values = cursor.number(2).ok_or_else(torn)? as usize;
            let padding = if version == 1 && values % 2 == 1 { 4 } else { 0 };
            cursor.skip(name.next_multiple_of(8) + 4 * values + padding).ok_or_else(torn)?;
        }
        Ok(())
    }

    pub(super) fn data_set(
        &self,
        place: &str,
        space: &Message,
        kind: &Message,
        layout: &Message,
    ) -> Result<DataSet, Refusal> {
        let extent = self.extent(place, space)?;
        let torn = || self.damaged(place, kind.at, "the data type is torn");
        let mut cursor = numbers(&kind.data);
        let class = cursor.number(1).ok_or_else(torn)? & 15;
        cursor.skip(3).ok_or_else(torn)?;
        let element_bytes = cursor.number(4).ok_or_else(torn)?;
        let is_number = matches!(class, 0 | 1) && (1..=8).contains(&element_bytes);
        let is_text = class == 3 && element_bytes <= 1 << 16;
        if !is_number && !is_text {
            let what = format!("elements of data type class {class} and {element_bytes} bytes (accepted are numbers)");
            return Err(self.unaccepted(place, what));
        }
        let data_set = DataSet { extent, element_bytes, is_float: class == 1 };
        if data_set.elements().saturating_mul(element_bytes) > LARGEST_DATA {
            return Err(self.unaccepted(place, format!("an extent of {:?}", data_set.extent)));
        }
        self.layout(place, layout, &data_set)?;
        Ok(data_set)
    }

    fn extent(&self, place: &str, space: &Message) -> Result<Vec<u64>, Refusal> {
        let torn = || self.damaged(place, space.at, "the extent is torn");
        let mut cursor = numbers(&space.data);
        let version = cursor.number(1).ok_or_else(torn)?;
        let rank = cursor.number(1).ok_or_else(torn)?;
        cursor
            .skip(match version {
                1 => 6,
                2 => 2,
                _ => return Err(self.unaccepted(place, format!("extent version {version}"))),
            })
            .ok_or_else(torn)?;
        if rank > 4 {
            return Err(self.unaccepted(place, format!("{rank} dimensions")));
        }
        (0..rank).map(|_| cursor.number(8).ok_or_else(torn)).collect()
    }

    fn layout(&self, place: &str, layout: &Message, data_set: &DataSet) -> Result<(), Refusal> {
        let torn = || self.damaged(place, layout.at, "the layout is torn");
        let mut cursor = numbers(&layout.data);
        let version = cursor.number(1).ok_or_else(torn)?;
        if !matches!(version, 3 | 4) {
            return Err(self.unaccepted(place, format!("layout version {version}")));
        }
        match cursor.number(1).ok_or_else(torn)? {
            0 => Ok(()),
            1 => {
                let (at, size) = cursor.number(8).zip(cursor.number(8)).ok_or_else(torn)?;
                let fits = at == UNDEFINED || at.checked_add(size).is_some_and(|end| end <= self.file.size());
                if fits {
                    Ok(())
                } else {
                    Err(self.damaged(place, layout.at, "its data reach beyond the end of the file"))
                }
            }
            2 => {
                let width = if version == 3 {
                    4
                } else {
                    cursor.skip(1).ok_or_else(torn)?;
                    0
                };
                let rank = cursor.number(1).ok_or_else(torn)?;
                let width = if version == 3 {
                    cursor.skip(8).ok_or_else(torn)?;
                    width
                } else {
                    cursor.number(1).ok_or_else(torn)? as usize
                };
                if !(1..=8).contains(&width) || rank as usize != data_set.extent.len() + 1 {
                    return Err(self.damaged(place, layout.at, "its chunks do not fit its extent"));
                }
                let mut bytes = 1_u64;
                for _ in 0..rank {
                    bytes = bytes.saturating_mul(cursor.number(width).ok_or_else(torn)?);
                }
                if bytes == 0 || bytes > LARGEST_BLOCK {
                    return Err(self.unaccepted(place, format!("chunks of {bytes} bytes")));
                }
                Ok(())
            }
            3 => Err(self.unaccepted(place, "a virtual layout (its data lie in other files)")),
            other => Err(self.unaccepted(place, format!("layout class {other}"))),
        }
    }
}
