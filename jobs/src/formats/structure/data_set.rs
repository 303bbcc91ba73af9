//! What data sets say of themselves: extent, type, layout, filters.

use super::chunk_index::ChunkIndex;
use super::element::Element;
use super::header::Message;
use super::{Bytes, DataSet, FILTERS, LARGEST_BLOCK, LARGEST_DATA, Reader, Refusal, Storage, UNDEFINED, numbers};

/// Axes of a data set at most: time, three of space, components.
const MOST_AXES: u64 = 5;
/// Filters of a data set at most.
const MOST_FILTERS: u64 = 8;

impl<B: Bytes + ?Sized> Reader<'_, B> {
    pub(super) fn filters(&self, place: &str, message: &Message) -> Result<Vec<u16>, Refusal> {
        let torn = || self.damaged(place, message.at, "the filter pipeline is torn");
        let mut cursor = numbers(&message.data);
        let version = cursor.number(1).ok_or_else(torn)?;
        let count = cursor.number(1).ok_or_else(torn)?;
        if version == 1 {
            cursor.skip(6).ok_or_else(torn)?;
        }
        if count > MOST_FILTERS {
            return Err(self.unaccepted(place, format!("{count} filters; at most {MOST_FILTERS} are undone")));
        }
        let mut found = Vec::new();
        for _ in 0..count {
            let id = cursor.number(2).ok_or_else(torn)? as u16;
            if !FILTERS.contains(&id) {
                let what = format!(
                    "filter {id} (deflate, shuffle and Fletcher-32 are accepted; h5repack -f GZIP=6 changes it)"
                );
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
        let (extent, most) = self.extent(place, space)?;
        let torn = || self.damaged(place, kind.at, "the data type is torn");
        let (element, element_bytes) = Element::from_message(&kind.data).ok_or_else(torn)?;
        let storage = Storage::OnePiece { at: UNDEFINED, bytes: 0 };
        let mut data_set = DataSet { extent, most, element_bytes, element, storage };
        if data_set.elements().saturating_mul(element_bytes) > LARGEST_DATA {
            return Err(self.unaccepted(place, format!("an extent of {:?}", data_set.extent)));
        }
        let filters = filters.map_or(Ok(Vec::new()), |message| self.filters(place, message))?;
        data_set.storage = self.layout(place, layout, &data_set, filters)?;
        Ok(data_set)
    }

    /// The extent, and that which the data set may grow to.
    pub(super) fn extent(&self, place: &str, space: &Message) -> Result<(Vec<u64>, Vec<u64>), Refusal> {
        let torn = || self.damaged(place, space.at, "the extent is torn");
        let mut cursor = numbers(&space.data);
        let version = cursor.number(1).ok_or_else(torn)?;
        let rank = cursor.number(1).ok_or_else(torn)?;
        let flags = cursor.number(1).ok_or_else(torn)?;
        cursor
            .skip(match version {
                1 => 5,
                2 => 1,
                _ => return Err(self.unaccepted(place, format!("extent version {version}"))),
            })
            .ok_or_else(torn)?;
        if rank > MOST_AXES {
            return Err(self.unaccepted(place, format!("{rank} dimensions")));
        }
        let mut axes = || (0..rank).map(|_| cursor.number(8)).collect::<Option<Vec<u64>>>().ok_or_else(torn);
        // An extent of version 2 and class 2 has no elements.
        if version == 2 && space.data.get(3) == Some(&2) {
            return Ok((vec![0], vec![0]));
        }
        let extent = axes()?;
        let most = if flags & 1 == 1 { axes()? } else { extent.clone() };
        if extent.iter().zip(&most).any(|(extent, most)| extent > most) {
            return Err(self.damaged(place, space.at, "an extent is larger than the extent that it may grow to"));
        }
        Ok((extent, most))
    }

    fn layout(&self, place: &str, layout: &Message, data_set: &DataSet, filters: Vec<u16>) -> Result<Storage, Refusal> {
        let torn = || self.damaged(place, layout.at, "the layout is torn");
        let mut cursor = numbers(&layout.data);
        let version = cursor.number(1).ok_or_else(torn)?;
        if !matches!(version, 3..=5) {
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
            2 if version == 3 => self.old_chunks(place, layout, data_set, filters),
            2 => self.new_chunks(place, layout, data_set, filters),
            3 => Err(self.unaccepted(
                place,
                "a virtual layout, whose numbers lie in other data sets (h5repack -l CONTI writes them into the file)",
            )),
            other => Err(self.unaccepted(place, format!("layout class {other}"))),
        }
    }

    /// Chunks of layout version 3: by a version 1 tree.
    fn old_chunks(
        &self,
        place: &str,
        layout: &Message,
        data_set: &DataSet,
        filters: Vec<u16>,
    ) -> Result<Storage, Refusal> {
        let torn = || self.damaged(place, layout.at, "the layout is torn");
        let mut cursor = numbers(&layout.data);
        cursor.skip(2).ok_or_else(torn)?;
        let (rank, at) = cursor.number(1).zip(cursor.number(8)).ok_or_else(torn)?;
        let extent = (0..rank).map(|_| cursor.number(4)).collect::<Option<Vec<u64>>>().ok_or_else(torn)?;
        let extent = self.chunk_extent(place, layout, extent, data_set)?;
        Ok(Storage::Chunks { index: ChunkIndex::Tree { at }, extent, filters, are_edges_plain: false })
    }

    /// Chunks of layout versions 4 and 5: by one of five indexes.
    fn new_chunks(
        &self,
        place: &str,
        layout: &Message,
        data_set: &DataSet,
        filters: Vec<u16>,
    ) -> Result<Storage, Refusal> {
        let torn = || self.damaged(place, layout.at, "the layout is torn");
        let mut cursor = numbers(&layout.data);
        cursor.skip(2).ok_or_else(torn)?;
        let flags = cursor.number(1).ok_or_else(torn)?;
        let (rank, width) = cursor.number(1).zip(cursor.number(1)).ok_or_else(torn)?;
        if !(1..=8).contains(&width) {
            return Err(torn());
        }
        let extent = (0..rank).map(|_| cursor.number(width as usize)).collect::<Option<Vec<u64>>>().ok_or_else(torn)?;
        let extent = self.chunk_extent(place, layout, extent, data_set)?;
        let kind = cursor.number(1).ok_or_else(torn)?;
        let filtered = if kind == 1 && flags & 2 != 0 {
            Some(cursor.number(8).zip(cursor.number(4)).ok_or_else(torn)?)
        } else {
            // What the index needs to grow.
            let parameters = match kind {
                1 | 2 => 0,
                3 => 1,
                4 => 5,
                5 => 6,
                _ => return Err(self.unaccepted(place, format!("a chunk index of type {kind}"))),
            };
            cursor.skip(parameters).ok_or_else(torn)?;
            None
        };
        let at = cursor.number(8).ok_or_else(torn)?;
        let index = match kind {
            1 => ChunkIndex::Single { at, filtered },
            2 => ChunkIndex::Implicit { at },
            3 => ChunkIndex::FixedArray { at },
            4 => ChunkIndex::ExtensibleArray { at },
            _ => ChunkIndex::Tree2 { at },
        };
        Ok(Storage::Chunks { index, extent, filters, are_edges_plain: flags & 1 != 0 })
    }

    /// The extent of chunks, behind which stands the size of an element.
    fn chunk_extent(
        &self,
        place: &str,
        layout: &Message,
        mut extent: Vec<u64>,
        data_set: &DataSet,
    ) -> Result<Vec<u64>, Refusal> {
        let bytes = extent.iter().fold(1_u64, |product, n| product.saturating_mul(*n));
        if bytes == 0 || bytes > LARGEST_BLOCK {
            return Err(self.unaccepted(place, format!("chunks of {bytes} bytes")));
        }
        let element_bytes = extent.pop();
        if element_bytes != Some(data_set.element_bytes) || extent.len() != data_set.extent.len() {
            return Err(self.damaged(place, layout.at, "its chunks do not fit its extent"));
        }
        Ok(extent)
    }
}
