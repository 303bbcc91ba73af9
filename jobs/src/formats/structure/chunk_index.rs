//! Where the chunks of a data set are, by each kind of index.

use super::{Bytes, DEEPEST, DataSet, MOST_CHUNKS, MOST_NODES, Reader, Refusal, UNDEFINED, numbers};
use std::collections::BTreeSet;

/// How the chunks of a data set are found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ChunkIndex {
    /// By a version 1 tree.
    Tree {
        /// Address of its root.
        at: u64,
    },
    /// There is one.
    Single {
        /// Address of the chunk.
        at: u64,
        /// Bytes of the chunk behind its filters, and a mask of those that were skipped; None without filters.
        filtered: Option<(u64, u64)>,
    },
    /// They follow one another.
    Implicit {
        /// Address of the first.
        at: u64,
    },
    /// By an array of fixed length.
    FixedArray {
        /// Address of its header.
        at: u64,
    },
    /// By an array that grows along one axis.
    ExtensibleArray {
        /// Address of its header.
        at: u64,
    },
    /// By a version 2 tree.
    Tree2 {
        /// Address of its header.
        at: u64,
    },
}

impl ChunkIndex {
    /// Address of the index, or of the first chunk where there is none.
    fn at(&self) -> u64 {
        match self {
            Self::Tree { at }
            | Self::Single { at, .. }
            | Self::Implicit { at }
            | Self::FixedArray { at }
            | Self::ExtensibleArray { at }
            | Self::Tree2 { at } => *at,
        }
    }
}

/// A chunk in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Chunk {
    /// Its place in the grid of chunks.
    pub place: Vec<u64>,
    /// What an index says of it.
    pub entry: Entry,
}

/// What an index says of a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Entry {
    /// Address of the chunk.
    pub at: u64,
    /// Bytes in the file.
    pub bytes: u64,
    /// Mask of the filters that were not applied.
    pub skipped: u64,
}

/// The grid of chunks over a data set.
pub(super) struct Grid<'a> {
    /// The data set.
    pub data_set: &'a DataSet,
    /// Extent of a chunk.
    pub chunk: &'a [u64],
    /// Bytes of a chunk without filters.
    pub size: u64,
    /// Whether there are filters, so that indexes hold sizes.
    pub has_filters: bool,
}

/// Types of version 2 trees over chunks without and with filters.
const PLAIN_CHUNKS: u8 = 10;
const FILTERED_CHUNKS: u8 = 11;

impl Grid<'_> {
    /// Number of chunks along each axis.
    pub fn counts(&self) -> Vec<u64> {
        self.data_set.extent.iter().zip(self.chunk).map(|(n, chunk)| n.div_ceil(*chunk)).collect()
    }

    /// Number of chunks.
    pub fn total(&self) -> u64 {
        self.counts().iter().fold(1, |product, n| product.saturating_mul(*n))
    }

    /// The places of all chunks, the last axis fastest.
    pub fn places(&self) -> impl Iterator<Item = Vec<u64>> {
        let counts = self.counts();
        (0..self.total()).map(move |k| {
            let mut rest = k;
            let mut place: Vec<u64> = counts
                .iter()
                .rev()
                .map(|n| {
                    let here = rest % n;
                    rest /= n;
                    here
                })
                .collect();
            place.reverse();
            place
        })
    }

    /// The number of a chunk in an array: over the extent that the data set may grow to, with the axis without a limit first.
    pub fn number(&self, place: &[u64]) -> u64 {
        let most = self.data_set.most.iter().zip(self.chunk).map(|(most, chunk)| most.div_ceil(*chunk));
        let mut axes: Vec<(u64, u64)> = most.zip(place.iter().copied()).collect();
        if let Some(free) = self.data_set.most.iter().position(|most| *most == UNDEFINED) {
            axes[..=free].rotate_right(1);
        }
        axes.iter().fold(0, |number, (most, here)| number.saturating_mul(*most).saturating_add(*here))
    }
}

impl<B: Bytes + ?Sized> Reader<'_, B> {
    /// All chunks of a data set; those that were never written are missing.
    pub(super) fn chunks(&self, place: &str, index: &ChunkIndex, grid: &Grid) -> Result<Vec<Chunk>, Refusal> {
        let total = grid.total();
        if total > MOST_CHUNKS {
            return Err(self.unaccepted(place, format!("{total} chunks; at most {MOST_CHUNKS} are read")));
        }
        if index.at() == UNDEFINED {
            return Ok(Vec::new());
        }
        let plain = |at: u64| Entry { at, bytes: grid.size, skipped: 0 };
        match index {
            ChunkIndex::Tree { at } => self.tree_chunks(place, *at, grid),
            ChunkIndex::Tree2 { at } => self.tree_2_chunks(place, *at, grid),
            ChunkIndex::Single { at, filtered } => {
                let entry = filtered.map_or(plain(*at), |(bytes, skipped)| Entry { at: *at, bytes, skipped });
                if total != 1 {
                    return Err(self.damaged(place, *at, "one chunk does not cover its extent"));
                }
                Ok(vec![Chunk { place: vec![0; grid.chunk.len()], entry }])
            }
            ChunkIndex::Implicit { at } => {
                let entry = |number: u64| number.checked_mul(grid.size).and_then(|offset| at.checked_add(offset));
                let all = grid.places().map(|found| entry(grid.number(&found)).map(|at| (found, plain(at))));
                let all = all.collect::<Option<Vec<_>>>();
                let all = all.ok_or_else(|| self.damaged(place, *at, "its chunks reach beyond the end of the file"))?;
                Ok(all.into_iter().map(|(place, entry)| Chunk { place, entry }).collect())
            }
            ChunkIndex::FixedArray { at } | ChunkIndex::ExtensibleArray { at } => {
                let needed =
                    grid.places().map(|place| grid.number(&place)).max().map_or(0, |last| last.saturating_add(1));
                if needed > MOST_CHUNKS {
                    return Err(
                        self.unaccepted(place, format!("an array of {needed} chunks; at most {MOST_CHUNKS} are read"))
                    );
                }
                let entries = match index {
                    ChunkIndex::FixedArray { .. } => self.fixed_array(place, *at, needed, grid)?,
                    _ => self.extensible_array(place, *at, needed, grid)?,
                };
                let entry = |found: &[u64]| entries.get(grid.number(found) as usize).copied().flatten();
                let all = grid.places().filter_map(|place| entry(&place).map(|entry| Chunk { place, entry }));
                Ok(all.collect())
            }
        }
    }

    /// Chunks by a version 1 tree: each key has the size of its chunk, a mask of skipped filters and its place.
    fn tree_chunks(&self, place: &str, tree: u64, grid: &Grid) -> Result<Vec<Chunk>, Refusal> {
        let key_bytes = 8 + 8 * (grid.chunk.len() as u64 + 1);
        let mut found = Vec::new();
        let (mut nodes, mut seen) = (vec![(tree, 0)], BTreeSet::new());
        while let Some((at, depth)) = nodes.pop() {
            let torn = || self.damaged(place, at, "the tree of its chunks is torn");
            if !seen.insert(at) || depth > DEEPEST || seen.len() > MOST_NODES {
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
                let (bytes, skipped) = cursor.number(4).zip(cursor.number(4)).ok_or_else(torn)?;
                let mut corner = Vec::new();
                for _ in grid.chunk {
                    corner.push(cursor.number(8).ok_or_else(torn)?);
                }
                cursor.skip(8).ok_or_else(torn)?;
                let child = cursor.number(8).ok_or_else(torn)?;
                if !is_leaf {
                    nodes.push((child, depth + 1));
                    continue;
                }
                if corner.iter().zip(grid.chunk).any(|(corner, chunk)| corner % chunk != 0) {
                    return Err(torn());
                }
                let place = corner.iter().zip(grid.chunk).map(|(corner, chunk)| corner / chunk).collect();
                found.push(Chunk { place, entry: Entry { at: child, bytes, skipped } });
                if found.len() as u64 > MOST_CHUNKS {
                    return Err(torn());
                }
            }
        }
        Ok(found)
    }

    /// Chunks by a version 2 tree: each record has an address, behind filters the size and mask, and the place.
    fn tree_2_chunks(&self, place: &str, tree: u64, grid: &Grid) -> Result<Vec<Chunk>, Refusal> {
        let torn = || self.damaged(place, tree, "the tree of its chunks is torn");
        let kind = if grid.has_filters { FILTERED_CHUNKS } else { PLAIN_CHUNKS };
        let axes = 8 * grid.chunk.len();
        let mut found = Vec::new();
        for record in self.records(place, tree, &[kind], MOST_CHUNKS)? {
            let (entry, corner) = record.split_at_checked(record.len().saturating_sub(axes)).ok_or_else(torn)?;
            let entry = self.entry(entry, grid).ok_or_else(torn)?;
            let place: Vec<u64> = corner.as_chunks::<8>().0.iter().map(|bytes| u64::from_le_bytes(*bytes)).collect();
            if place.len() != grid.chunk.len() {
                return Err(torn());
            }
            found.push(Chunk { place, entry });
        }
        Ok(found)
    }

    /// An entry of an index: an address, and behind filters a size and a mask of 4 bytes.
    pub(super) fn entry(&self, bytes: &[u8], grid: &Grid) -> Option<Entry> {
        let mut cursor = numbers(bytes);
        let at = cursor.number(8)?;
        if !grid.has_filters {
            return (bytes.len() == 8).then_some(Entry { at, bytes: grid.size, skipped: 0 });
        }
        let width = bytes.len().checked_sub(12).filter(|width| (1..=8).contains(width))?;
        Some(Entry { at, bytes: cursor.number(width)?, skipped: cursor.number(4)? })
    }
}
