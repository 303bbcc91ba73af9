//! The numbers of a data set, read from its piece or its chunks.

use super::chunk_index::Grid;
use super::filters::undo;
use super::{Bytes, DataSet, LARGEST_DATA, Reader, Refusal, Storage, UNDEFINED};
use std::collections::BTreeSet;

/// The bytes of a data set, row after row.
///
/// # Errors
/// [`Refusal`].
pub fn contents(file: &(impl Bytes + ?Sized), place: &str, data_set: &DataSet) -> Result<Vec<u8>, Refusal> {
    let reader = Reader::new(file);
    let bytes = data_set.elements().saturating_mul(data_set.element_bytes);
    match &data_set.storage {
        _ if bytes == 0 => Ok(Vec::new()),
        Storage::OnePiece { at, bytes: found } if *at != UNDEFINED && *found >= bytes => {
            if bytes > file.size() {
                return Err(reader.damaged(place, *at, "it has fewer bytes than its extent"));
            }
            let mut data = vec![0; bytes as usize];
            if file.fill(*at, &mut data) { Ok(data) } else { Err(reader.damaged(place, *at, "the file ends too soon")) }
        }
        Storage::OnePiece { at: UNDEFINED, .. } => Err(reader.unaccepted(place, "numbers that were never written")),
        Storage::OnePiece { at, .. } => Err(reader.damaged(place, *at, "it has fewer bytes than its extent")),
        Storage::Chunks { .. } => reader.chunked(place, data_set),
    }
}

/// The elements of a data set as numbers.
///
/// # Errors
/// [`Refusal`], also where they are no numbers.
pub fn reals(file: &(impl Bytes + ?Sized), place: &str, data_set: &DataSet) -> Result<Vec<f64>, Refusal> {
    let bytes = contents(file, place, data_set)?;
    let values = bytes.chunks_exact(data_set.element_bytes.max(1) as usize).map(|bytes| data_set.element.real(bytes));
    let values = values.collect::<Option<Vec<f64>>>().filter(|values| values.len() as u64 == data_set.elements());
    values.ok_or_else(|| Reader::new(file).unaccepted(place, "elements that are no numbers"))
}

/// The elements of a data set as whole numbers.
///
/// # Errors
/// [`Refusal`], also where they are none.
pub fn integers(file: &(impl Bytes + ?Sized), place: &str, data_set: &DataSet) -> Result<Vec<i64>, Refusal> {
    let bytes = contents(file, place, data_set)?;
    let values =
        bytes.chunks_exact(data_set.element_bytes.max(1) as usize).map(|bytes| data_set.element.integer(bytes));
    let values = values.collect::<Option<Vec<i64>>>().filter(|values| values.len() as u64 == data_set.elements());
    values.ok_or_else(|| Reader::new(file).unaccepted(place, "elements that are no whole numbers of 63 bits"))
}

impl<B: Bytes + ?Sized> Reader<'_, B> {
    /// Puts the chunks of a data set together.
    fn chunked(&self, place: &str, data_set: &DataSet) -> Result<Vec<u8>, Refusal> {
        let Storage::Chunks { index, extent: chunk, filters, are_edges_plain } = &data_set.storage else {
            return Ok(Vec::new());
        };
        let size = chunk.iter().fold(data_set.element_bytes, |product, n| product.saturating_mul(*n));
        let grid = Grid { data_set, chunk, size, has_filters: !filters.is_empty() };
        if chunk.len() != data_set.extent.len() || grid.total().saturating_mul(size) > LARGEST_DATA {
            return Err(self.unaccepted(place, format!("{} chunks of {size} bytes", grid.total())));
        }
        let counts = grid.counts();
        let mut chunks = self.chunks(place, index, &grid)?;
        // A data set that was made smaller may keep chunks beyond its extent.
        chunks.retain(|found| found.place.iter().zip(&counts).all(|(here, count)| here < count));
        let places: BTreeSet<&Vec<u64>> = chunks.iter().map(|found| &found.place).collect();
        if places.len() < chunks.len() {
            return Err(self.unaccepted(place, "two chunks at one place"));
        }
        if (places.len() as u64) < grid.total() {
            let what =
                format!("numbers that were never written ({} of {} chunks are there)", places.len(), grid.total());
            return Err(self.unaccepted(place, what));
        }
        let mut data = vec![0; (data_set.elements() * data_set.element_bytes) as usize];
        for found in &chunks {
            let torn = |what: &'static str| self.damaged(place, found.entry.at, what);
            let is_edge = found.place.iter().zip(chunk).zip(&data_set.extent).any(|((k, c), n)| (k + 1) * c > *n);
            let is_plain = filters.is_empty() || (*are_edges_plain && is_edge);
            if is_plain && found.entry.bytes != size {
                return Err(torn("a chunk has another size than its extent says"));
            }
            let bytes = self.bytes(place, found.entry.at, found.entry.bytes)?;
            let applied = if is_plain { &[] } else { filters.as_slice() };
            let bytes = undo(bytes, applied, found.entry.skipped, data_set.element_bytes, size).map_err(torn)?;
            copy(&bytes, &found.place, data_set, chunk, &mut data);
        }
        Ok(data)
    }
}

/// Copies the part of a chunk that lies within the extent, row by row.
fn copy(bytes: &[u8], place: &[u64], data_set: &DataSet, chunk: &[u64], data: &mut [u8]) {
    let width = data_set.element_bytes;
    let Some(last) = chunk.len().checked_sub(1) else { return data.copy_from_slice(bytes) };
    let start: Vec<u64> = place.iter().zip(chunk).map(|(k, c)| k * c).collect();
    let within: Vec<u64> =
        start.iter().zip(chunk).zip(&data_set.extent).map(|((start, c), n)| (*c).min(n - start)).collect();
    let rows = within[..last].iter().product::<u64>();
    for row in 0..rows {
        let (mut rest, mut from, mut to) = (row, 0, 0);
        let (mut from_stride, mut to_stride) = (chunk[last], data_set.extent[last]);
        for axis in (0..last).rev() {
            let here = rest % within[axis];
            rest /= within[axis];
            from += here * from_stride;
            to += (start[axis] + here) * to_stride;
            from_stride *= chunk[axis];
            to_stride *= data_set.extent[axis];
        }
        let (from, to) = ((from * width) as usize, ((to + start[last]) * width) as usize);
        let length = (within[last] * width) as usize;
        data[to..to + length].copy_from_slice(&bytes[from..from + length]);
    }
}
