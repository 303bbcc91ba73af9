//! The numbers of a data set as they stand in the file, read without libhdf5: that may hang or end the process over a
//! damaged file, and a checkpoint must be refused instead.

use super::{Bytes, DEEPEST, DataSet, MOST_OBJECTS, Reader, Refusal, Storage, Structure, UNDEFINED, numbers};
use std::collections::BTreeSet;

/// Fletcher-32, the only filter that leaves the numbers as they are.
const CHECKSUM: u16 = 3;

/// The bytes of a data set, row after row. Accepted are numbers in one piece, and chunks without compression.
///
/// # Errors
/// [`Refusal`].
pub fn contents(file: &(impl Bytes + ?Sized), place: &str, data_set: &DataSet) -> Result<Vec<u8>, Refusal> {
    let reader = Reader { file, structure: Structure::default(), visited: BTreeSet::new() };
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
        Storage::OnePiece { at, .. } => Err(reader.damaged(place, *at, "it has fewer bytes than its extent")),
        Storage::Chunks { tree, extent, filters } if filters.iter().all(|filter| *filter == CHECKSUM) => {
            if bytes > file.size() {
                return Err(reader.damaged(place, *tree, "it has fewer bytes than its extent"));
            }
            reader.chunks(place, *tree, extent, filters.len() as u64 * 4, data_set)
        }
        _ => Err(reader.unaccepted(place, "compressed numbers or a chunk index of a later version")),
    }
}

impl<B: Bytes + ?Sized> Reader<'_, B> {
    /// Chunks by a version 1 tree: each key has the size of its chunk, a mask of skipped filters and its place.
    fn chunks(
        &self,
        place: &str,
        tree: u64,
        chunk: &[u64],
        checksum: u64,
        data_set: &DataSet,
    ) -> Result<Vec<u8>, Refusal> {
        // Rows may be cut, columns may not: that is how the numbers of this program lie.
        if data_set.extent.is_empty() || chunk.len() != data_set.extent.len() || chunk[1..] != data_set.extent[1..] {
            return Err(self.unaccepted(place, "chunks that cut its rows"));
        }
        let row_bytes = data_set.extent[1..].iter().fold(data_set.element_bytes, |product, n| product * n);
        let chunk_bytes = row_bytes * chunk[0];
        let mut data = vec![0; (data_set.extent[0] * row_bytes) as usize];
        let key_bytes = 8 + 8 * (chunk.len() as u64 + 1);
        let (mut nodes, mut seen, mut rows) = (vec![(tree, 0)], BTreeSet::new(), BTreeSet::new());
        while let Some((at, depth)) = nodes.pop() {
            let torn = || self.damaged(place, at, "the tree of its chunks is torn");
            if !seen.insert(at) || depth > DEEPEST || seen.len() > MOST_OBJECTS {
                return Err(torn());
            }
            let head = self.bytes(place, at, 8)?;
            if !head.starts_with(b"TREE") || head[4] != 1 {
                return Err(torn());
            }
            let is_leaf = head[5] == 0;
            let count = numbers(&head[6..]).number(2).ok_or_else(torn)?;
            let body = self.bytes(place, at.checked_add(24).ok_or_else(torn)?, count * (key_bytes + 8))?;
            for entry in body.chunks_exact(key_bytes as usize + 8) {
                let mut cursor = numbers(entry);
                let (size, mask, row) = cursor
                    .number(4)
                    .zip(cursor.number(4))
                    .zip(cursor.number(8))
                    .map(|((size, mask), row)| (size, mask, row))
                    .ok_or_else(torn)?;
                cursor.skip(key_bytes as usize - 16).ok_or_else(torn)?;
                let child = cursor.number(8).ok_or_else(torn)?;
                if !is_leaf {
                    nodes.push((child, depth + 1));
                    continue;
                }
                let fits =
                    size == chunk_bytes + checksum && mask == 0 && row % chunk[0] == 0 && row < data_set.extent[0];
                if !fits || !rows.insert(row) {
                    return Err(torn());
                }
                let found = self.bytes(place, child, chunk_bytes)?;
                let from = (row * row_bytes) as usize;
                let length = found.len().min(data.len() - from);
                data[from..from + length].copy_from_slice(&found[..length]);
            }
        }
        if rows.len() as u64 != data_set.extent[0].div_ceil(chunk[0]) {
            return Err(self.damaged(place, tree, "some of its chunks are missing"));
        }
        Ok(data)
    }
}
