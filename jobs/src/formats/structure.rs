//! HDF5 files as others write them, read by ourselves: superblock, object headers, groups, what data sets say of their type,
//! extent, layout and filters, and their numbers. Everything that could lead to another file (external links and storage,
//! virtual data sets, drivers that name members), to a plug-in (unknown filters), or to an extent that no memory holds is
//! refused before any number is read.
//!
//! No byte from outside meets libhdf5. The version that the program links (1.10) does not read what HDF5 2.0 writes as the
//! newest format. It may hang or end the process over a damaged file, and a gate before it must understand each file exactly
//! as it does, or something passes that the gate has not seen. So the numbers are read here, too: the one reading is the
//! gate. The service's inspection, `meniscus run` and checkpoints use it alike. What is not needed is passed over: soft
//! links are not followed, attributes are read where they are numbers in the header of a group, data sets of texts and
//! compounds stay as they are.
//!
//! After the HDF5 File Format Specification, version 3.0, and the layout version 5 of HDF5 2.0. Accepted are superblocks 0 to
//! 3, object headers 1 and 2, groups as symbol tables, compact links and dense links (fractal heap and version 2 tree), and
//! compact, contiguous and chunked layouts with every chunk index, behind deflate, shuffle and Fletcher-32. Check sums are
//! compared, of metadata and of chunks.

mod array_index;
mod attributes;
mod checksum;
mod chunk_index;
mod contents;
mod data_set;
mod dense_links;
mod element;
mod filters;
mod fractal_heap;
mod header;
mod links;
mod tree_2;

pub use contents::{contents, integers, reals};
pub use element::Element;

use checksum::lookup_3;
use chunk_index::ChunkIndex;
use header::Message;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::os::unix::fs::FileExt;

/// Bytes that can be read anywhere.
pub trait Bytes {
    /// How many there are.
    fn size(&self) -> u64;

    /// Fills a buffer from a place; false where the bytes end before.
    fn fill(&self, at: u64, buffer: &mut [u8]) -> bool;

    /// Whether check sums of metadata are compared. Tests turn it off to reach what is behind them.
    fn has_sums(&self) -> bool {
        true
    }
}

impl Bytes for [u8] {
    fn size(&self) -> u64 {
        self.len() as u64
    }

    fn fill(&self, at: u64, buffer: &mut [u8]) -> bool {
        let found = usize::try_from(at).ok().and_then(|at| self.get(at..at.checked_add(buffer.len())?));
        found.map(|found| buffer.copy_from_slice(found)).is_some()
    }
}

impl Bytes for File {
    fn size(&self) -> u64 {
        self.metadata().map_or(0, |meta| meta.len())
    }

    fn fill(&self, at: u64, buffer: &mut [u8]) -> bool {
        self.read_exact_at(buffer, at).is_ok()
    }
}

/// Why a file is refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// It does not begin like one.
    #[error("this is no HDF5 file (or one with a user block before it)")]
    NotHdf5,
    /// It ends before what it says, or says what cannot be.
    #[error("the file is damaged at {place} (byte {at}): {what}")]
    Damaged {
        /// Path of the object.
        place: String,
        /// Offset in the file, in bytes.
        at: u64,
        /// What is wrong.
        what: &'static str,
    },
    /// It has something that is not accepted.
    #[error("{place} has {what}, which is not accepted")]
    Unaccepted {
        /// Path of the object.
        place: String,
        /// What is not accepted.
        what: String,
    },
}

/// What a data set says of itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DataSet {
    /// Number of elements along each axis.
    pub extent: Vec<u64>,
    /// Number of elements along each axis that it may grow to; `u64::MAX` without a limit.
    pub most: Vec<u64>,
    /// Bytes of an element.
    pub element_bytes: u64,
    /// What its elements are.
    pub element: Element,
    /// Where its numbers are.
    pub storage: Storage,
}

/// Where the numbers of a data set are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Storage {
    /// In one piece of the file; no address where nothing was written.
    OnePiece {
        /// Where it begins.
        at: u64,
        /// Length in bytes.
        bytes: u64,
    },
    /// In chunks.
    Chunks {
        /// How they are found.
        index: ChunkIndex,
        /// Extent of a chunk.
        extent: Vec<u64>,
        /// Filters in the order of writing.
        filters: Vec<u16>,
        /// Whether chunks that reach beyond the extent are stored without filters.
        are_edges_plain: bool,
    },
}

impl DataSet {
    /// Number of elements.
    #[must_use]
    pub fn elements(&self) -> u64 {
        self.extent.iter().fold(1, |product, n| product.saturating_mul(*n))
    }

    /// Whether its elements are numbers.
    #[must_use]
    pub fn is_number(&self) -> bool {
        self.is_float() || matches!(self.element, Element::Integer { .. })
    }

    /// Whether its elements are floating-point numbers.
    #[must_use]
    pub fn is_float(&self) -> bool {
        matches!(self.element, Element::Float { .. })
    }
}

/// Everything in a file, by path.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Structure {
    /// Data sets by path.
    pub data_sets: BTreeMap<String, DataSet>,
    /// Groups, the root as the empty path.
    pub groups: BTreeSet<String>,
    /// Numbers of attributes, by the path of their group and, behind an @, their name.
    pub attributes: BTreeMap<String, Vec<f64>>,
}

/// What HDF5 files begin with.
pub const SIGNATURE: &[u8; 8] = b"\x89HDF\r\n\x1a\n";
const UNDEFINED: u64 = u64::MAX;
/// Objects of a file at most.
const MOST_OBJECTS: usize = 4096;
/// Groups inside groups at most.
const DEEPEST: usize = 8;
/// Bytes of a header's block, a heap or a chunk at most.
const LARGEST_BLOCK: u64 = 64 << 20;
/// Bytes of header messages that one object may have, and messages.
const LARGEST_HEADER: u64 = 4 << 20;
const MOST_MESSAGES: usize = 4096;
/// Chunks of a data set at most, and nodes of the trees that list them.
const MOST_CHUNKS: u64 = 1 << 22;
const MOST_NODES: usize = 1 << 17;
/// Bytes of a data set at most.
const LARGEST_DATA: u64 = 4 << 30;
/// Bytes of a check sum, and of a superblock of version 2 or 3 before it.
const SUM: u64 = 4;
const NEW_SUPERBLOCK: u64 = 44;
/// Marks of a superblock of version 3 that it is open for writing, alone or beside readers.
const IS_OPEN: u8 = 5;
/// Deflate, shuffle, Fletcher-32.
const FILTERS: [u16; 3] = [1, 2, 3];

/// Reads the structure of a file.
///
/// # Errors
/// [`Refusal`] at the first thing that is not accepted.
pub fn read(file: &(impl Bytes + ?Sized)) -> Result<Structure, Refusal> {
    let mut reader = Reader::new(file);
    let root = reader.superblock()?;
    reader.object("", root, 0)?;
    if !reader.structure.groups.contains("") {
        return Err(reader.damaged("", root, "the root is no group"));
    }
    Ok(reader.structure)
}

struct Reader<'a, B: Bytes + ?Sized> {
    file: &'a B,
    structure: Structure,
    /// Headers that were read, each with the path of its data set.
    visited: BTreeMap<u64, Option<String>>,
}

/// Reads little-endian numbers from bytes, one after another.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Cursor<'_> {
    fn number(&mut self, width: usize) -> Option<u64> {
        let bytes = self.bytes.get(self.at..self.at.checked_add(width)?)?;
        self.at += width;
        Some(bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }

    fn skip(&mut self, width: usize) -> Option<()> {
        self.at = self.at.checked_add(width).filter(|at| *at <= self.bytes.len())?;
        Some(())
    }
}

fn numbers(bytes: &[u8]) -> Cursor<'_> {
    Cursor { bytes, at: 0 }
}

impl<'a, B: Bytes + ?Sized> Reader<'a, B> {
    fn new(file: &'a B) -> Self {
        Self { file, structure: Structure::default(), visited: BTreeMap::new() }
    }

    fn damaged(&self, place: &str, at: u64, what: &'static str) -> Refusal {
        Refusal::Damaged { place: shown(place), at, what }
    }

    fn unaccepted(&self, place: &str, what: impl Into<String>) -> Refusal {
        Refusal::Unaccepted { place: shown(place), what: what.into() }
    }

    fn bytes(&self, place: &str, at: u64, size: u64) -> Result<Vec<u8>, Refusal> {
        let fits = at.checked_add(size).is_some_and(|end| end <= self.file.size()) && size <= LARGEST_BLOCK;
        if !fits {
            return Err(self.damaged(place, at, "a block reaches beyond the end of the file"));
        }
        let mut bytes = vec![0; size as usize];
        if self.file.fill(at, &mut bytes) { Ok(bytes) } else { Err(self.damaged(place, at, "the file ends too soon")) }
    }

    /// The bytes of a block behind which stands its check sum.
    fn sealed(&self, place: &str, at: u64, size: u64) -> Result<Vec<u8>, Refusal> {
        let mut bytes = self.bytes(place, at, size.saturating_add(SUM))?;
        let sum = bytes.split_off(size as usize);
        self.check_sum(place, at, &bytes, &sum)?;
        Ok(bytes)
    }

    fn check_sum(&self, place: &str, at: u64, bytes: &[u8], sum: &[u8]) -> Result<(), Refusal> {
        if self.file.has_sums() && lookup_3(bytes).to_le_bytes() != sum {
            return Err(self.damaged(place, at, "a block does not match its check sum"));
        }
        Ok(())
    }

    /// The address of the root's header.
    fn superblock(&self) -> Result<u64, Refusal> {
        let head = self.bytes("", 0, 20).map_err(|_| Refusal::NotHdf5)?;
        if head.get(..8) != Some(SIGNATURE) {
            return Err(Refusal::NotHdf5);
        }
        let version = head[8];
        let (widths, body, size) = match version {
            0 => ([head[13], head[14]], 24, 72),
            1 => ([head[13], head[14]], 28, 72),
            2 | 3 => ([head[9], head[10]], 12, 32),
            _ => return Err(self.unaccepted("", format!("superblock version {version}"))),
        };
        if widths != [8, 8] {
            return Err(self.unaccepted("", "addresses that are not 8 bytes wide"));
        }
        // libhdf5 refuses trees without members, and files that a program has open or did not close.
        if version < 2 && (head[16..18] == [0; 2] || head[18..20] == [0; 2]) {
            return Err(self.damaged("", 16, "its trees have no members"));
        }
        if version == 3 && head[11] & IS_OPEN != 0 {
            let what = "a mark that a program writes it or ended without closing it (h5clear -s takes the mark away)";
            return Err(self.unaccepted("", what));
        }
        let bytes = self.bytes("", body, size)?;
        let mut cursor = numbers(&bytes);
        let mut next = || cursor.number(8).unwrap_or(UNDEFINED);
        let (base, second, end) = (next(), next(), next());
        if base != 0 {
            return Err(self.unaccepted("", "a base address that is not 0"));
        }
        if end > self.file.size() {
            let what = "it was cut off, or is still being written: it ends before its end-of-file address";
            return Err(self.damaged("", body + 16, what));
        }
        if version >= 2 {
            let root = next();
            self.sealed("", 0, NEW_SUPERBLOCK)?;
            if second != UNDEFINED {
                self.check_extension(second)?;
            }
            return Ok(root);
        }
        // The second address is of free space, which is of no use to a reader; the fourth is of a driver's information.
        if next() != UNDEFINED {
            return Err(self.unaccepted("", "a driver information block"));
        }
        next();
        Ok(next())
    }

    /// Reads an object and everything below it.
    fn object(&mut self, place: &str, at: u64, depth: usize) -> Result<(), Refusal> {
        if let Some(known) = self.visited.get(&at) {
            return self.again(place, known.clone());
        }
        self.visited.insert(at, None);
        if self.visited.len() > MOST_OBJECTS {
            return Err(self.unaccepted(place, format!("more than {MOST_OBJECTS} objects before it")));
        }
        if depth > DEEPEST {
            return Err(self.unaccepted(place, format!("more than {DEEPEST} groups around it")));
        }
        let messages = self.messages(place, at)?;
        for message in &messages {
            self.check(place, message)?;
        }
        let find = |kind: u16| messages.iter().find(|message| message.kind == kind);
        for (kind, name) in [
            (0x01, "extents"),
            (0x02, "tables of links"),
            (0x03, "types"),
            (0x08, "layouts"),
            (0x0B, "pipelines"),
            (0x11, "symbol tables"),
        ] {
            if messages.iter().filter(|message| message.kind == kind).count() > 1 {
                return Err(self.unaccepted(place, format!("two {name}")));
            }
        }
        // What has members is a group, whatever else it is; nothing may hide behind a layout.
        if find(0x08).is_some() && messages.iter().any(|message| matches!(message.kind, 0x02 | 0x06 | 0x0A | 0x11)) {
            return Err(self.unaccepted(place, "members though it is a data set"));
        }
        if let Some(layout) = find(0x08) {
            let (Some(space), Some(kind)) = (find(0x01), find(0x03)) else {
                return Err(self.damaged(place, at, "a data set without extent or type"));
            };
            let data_set = self.data_set(place, space, kind, layout, find(0x0B))?;
            self.structure.data_sets.insert(place.to_owned(), data_set);
            self.visited.insert(at, Some(place.to_owned()));
            return Ok(());
        }
        if find(0x0B).is_some() {
            return Err(self.unaccepted(place, "a filter pipeline though it is a group"));
        }
        // A named data type has nothing to read.
        if find(0x03).is_some() {
            return Ok(());
        }
        self.structure.groups.insert(place.to_owned());
        for message in messages.iter().filter(|message| message.kind == 0x0C) {
            if let Some((name, values)) = self.attribute(message) {
                self.structure.attributes.insert(format!("{place}@{name}"), values);
            }
        }
        self.members(place, &messages, depth)
    }

    /// An object that was met before: another name of a data set, or a way around in circles.
    fn again(&mut self, place: &str, known: Option<String>) -> Result<(), Refusal> {
        let data_set = known.and_then(|known| self.structure.data_sets.get(&known).cloned());
        let data_set = data_set.ok_or_else(|| self.unaccepted(place, "more than one link to a group"))?;
        if self.structure.data_sets.len() >= MOST_OBJECTS {
            return Err(self.unaccepted(place, format!("more than {MOST_OBJECTS} data sets before it")));
        }
        self.structure.data_sets.insert(place.to_owned(), data_set);
        Ok(())
    }

    /// Reads the members of a group.
    fn members(&mut self, place: &str, messages: &[Message], depth: usize) -> Result<(), Refusal> {
        let mut found = Vec::new();
        for message in messages {
            match message.kind {
                0x02 => self.dense_links(place, message, &mut found)?,
                0x06 => found.push(self.link(place, message.at, &message.data)?),
                0x11 => self.symbol_table(place, message, &mut found)?,
                _ => {}
            }
        }
        let mut names = BTreeSet::new();
        for (name, target) in found {
            if name.is_empty() || name == "." || name.contains('/') || !names.insert(name.clone()) {
                return Err(self.unaccepted(place, format!("a member of the name {name:?}, or two of it")));
            }
            if let Some(target) = target {
                self.object(&format!("{place}/{name}"), target, depth + 1)?;
            }
        }
        Ok(())
    }
}

fn shown(place: &str) -> String {
    if place.is_empty() { "the file".to_owned() } else { place.to_owned() }
}

#[cfg(test)]
mod tests;
