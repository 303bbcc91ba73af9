//! What data sets say of themselves: extent, type, layout, filters.

use super::{
    Bytes, DataSet, FILTERS, LARGEST_BLOCK, LARGEST_DATA, Message, Reader, Refusal, Storage, UNDEFINED, numbers,
};

impl<B: Bytes + ?Sized> Reader<'_, B> {
    pub(super) fn filters(&self, place: &str, message: &Message) -> Result<Vec<u16>, Refusal> {
        let torn = || self.damaged(place, message.at, "the filter pipeline is torn");
        let mut cursor = numbers(&message.data);
        let version = cursor.number(1).ok_or_else(torn)?;
        let count = cursor.number(1).ok_or_else(torn)?;
        if version == 1 {
            cursor.skip(6).ok_or_else(torn)?;
        }
        let mut found = Vec::new();
        for _ in 0..count {
            let id = cursor.number(2).ok_or_else(torn)? as u16;
            if !FILTERS.contains(&id) {
                let what = format!("filter {id} (accepted are deflate, shuffle and Fletcher-32)");
                return Err(self.unaccepted(place, what));
            }
            found.push(id);
            let name = if version == 1 { cursor.number(2).ok_or_else(torn)? as usize } else { 0 };
            cursor.skip(2).ok_or_else(torn)?;
            let values = cursor.number(2).ok_or_else(torn)? as usize;
            let padding = if version == 1 && values % 2 == 1 { 4 } else { 0 };
            cursor.skip(name.next_multiple_of(8) + 4 * values + padding).ok_or_else(torn)?;
        }
        Ok(found)
    }

    pub(super) fn data_set(
        &self,
        place: &str,
        space: &Message,
        kind: &Message,
        layout: &Message,
        filters: Option<&Message>,
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
        let mut data_set = DataSet { extent, element_bytes, is_float: class == 1, storage: Storage::Other };
        if data_set.elements().saturating_mul(element_bytes) > LARGEST_DATA {
            return Err(self.unaccepted(place, format!("an extent of {:?}", data_set.extent)));
        }
        let filters = filters.map_or(Ok(Vec::new()), |message| self.filters(place, message))?;
        data_set.storage = self.layout(place, layout, &data_set, filters)?;
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

    fn layout(&self, place: &str, layout: &Message, data_set: &DataSet, filters: Vec<u16>) -> Result<Storage, Refusal> {
        let torn = || self.damaged(place, layout.at, "the layout is torn");
        let mut cursor = numbers(&layout.data);
        let version = cursor.number(1).ok_or_else(torn)?;
        if !matches!(version, 3 | 4) {
            return Err(self.unaccepted(place, format!("layout version {version}")));
        }
        match cursor.number(1).ok_or_else(torn)? {
            0 => {
                let bytes = cursor.number(2).ok_or_else(torn)?;
                let at = layout.at + cursor.at as u64;
                cursor.skip(bytes as usize).ok_or_else(torn)?;
                Ok(Storage::OnePiece { at, bytes })
            }
            1 => {
                let (at, size) = cursor.number(8).zip(cursor.number(8)).ok_or_else(torn)?;
                let fits = at == UNDEFINED || at.checked_add(size).is_some_and(|end| end <= self.file.size());
                if fits {
                    Ok(Storage::OnePiece { at, bytes: size })
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
                let (width, tree) = if version == 3 {
                    (width, Some(cursor.number(8).ok_or_else(torn)?))
                } else {
                    (cursor.number(1).ok_or_else(torn)? as usize, None)
                };
                if !(1..=8).contains(&width) || rank as usize != data_set.extent.len() + 1 {
                    return Err(self.damaged(place, layout.at, "its chunks do not fit its extent"));
                }
                let mut extent = Vec::new();
                for _ in 0..rank {
                    extent.push(cursor.number(width).ok_or_else(torn)?);
                }
                let bytes = extent.iter().fold(1_u64, |product, n| product.saturating_mul(*n));
                if bytes == 0 || bytes > LARGEST_BLOCK {
                    return Err(self.unaccepted(place, format!("chunks of {bytes} bytes")));
                }
                // Behind the extent of a chunk stands the size of an element.
                if extent.pop() != Some(data_set.element_bytes) && version == 3 {
                    return Err(self.damaged(place, layout.at, "its chunks do not fit its elements"));
                }
                Ok(tree.map_or(Storage::Other, |tree| Storage::Chunks { tree, extent, filters }))
            }
            3 => Err(self.unaccepted(place, "a virtual layout (its data lie in other files)")),
            other => Err(self.unaccepted(place, format!("layout class {other}"))),
        }
    }
}
