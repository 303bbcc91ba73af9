//! The structure of an HDF5 file, read by ourselves: superblock, object headers, groups, and what data sets say of their
//! type, extent, layout and filters. Everything that is not on a short list is refused, so that libhdf5 never meets a way
//! to another file (external links and storage, virtual data sets, drivers that name members), to a plug-in (unknown
//! filters), or an extent that no memory holds.
//!
//! After the HDF5 File Format Specification, version 3.0. Accepted are superblocks 0 to 3, object headers 1 and 2, groups as
//! symbol tables and as compact links, and compact, contiguous and chunked layouts of numbers.

mod contents;
mod data_set;

pub use contents::contents;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::os::unix::fs::FileExt;

/// Bytes that can be read anywhere.
pub trait Bytes {
    /// How many there are.
    fn size(&self) -> u64;

    /// Fills a buffer from a place; false where the bytes end before.
    fn fill(&self, at: u64, buffer: &mut [u8]) -> bool;
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
    /// Bytes of an element.
    pub element_bytes: u64,
    /// Whether elements are floating-point numbers; else they are whole numbers or fixed texts.
    pub is_float: bool,
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
    /// In chunks, found by a tree.
    Chunks {
        /// Address of the tree.
        tree: u64,
        /// Extent of a chunk.
        extent: Vec<u64>,
        /// Filters in the order of writing.
        filters: Vec<u16>,
    },
    /// In a way that only libhdf5 reads.
    Other,
}

impl DataSet {
    /// Number of elements.
    #[must_use]
    pub fn elements(&self) -> u64 {
        self.extent.iter().fold(1, |product, n| product.saturating_mul(*n))
    }
}

/// Everything in a file, by path.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Structure {
    /// Data sets by path.
    pub data_sets: BTreeMap<String, DataSet>,
    /// Groups, the root as the empty path.
    pub groups: BTreeSet<String>,
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
/// Bytes of a data set at most.
const LARGEST_DATA: u64 = 4 << 30;
/// Deflate, shuffle, Fletcher-32.
const FILTERS: [u16; 3] = [1, 2, 3];

/// Reads the structure of a file.
///
/// # Errors
/// [`Refusal`] at the first thing that is not accepted.
pub fn read(file: &(impl Bytes + ?Sized)) -> Result<Structure, Refusal> {
    let mut reader = Reader { file, structure: Structure::default(), visited: BTreeSet::new() };
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
    visited: BTreeSet<u64>,
}

/// A header message.
struct Message {
    kind: u16,
    flags: u8,
    at: u64,
    data: Vec<u8>,
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

impl<B: Bytes + ?Sized> Reader<'_, B> {
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

    /// The address of the root's header.
    fn superblock(&self) -> Result<u64, Refusal> {
        let head = self.bytes("", 0, 16).map_err(|_| Refusal::NotHdf5)?;
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
        let bytes = self.bytes("", body, size)?;
        let mut cursor = numbers(&bytes);
        let mut next = || cursor.number(8).unwrap_or(UNDEFINED);
        let (base, second, end) = (next(), next(), next());
        if base != 0 {
            return Err(self.unaccepted("", "a base address that is not 0"));
        }
        if end > self.file.size() {
            return Err(self.damaged("", body + 16, "it ends before its end-of-file address"));
        }
        if version >= 2 {
            if second != UNDEFINED {
                return Err(self.unaccepted("", "a superblock extension"));
            }
            return Ok(next());
        }
        // The second address is of free space, which is of no use to a reader; the fourth is of a driver's information.
        if next() != UNDEFINED {
            return Err(self.unaccepted("", "a driver information block"));
        }
        next();
        Ok(next())
    }

    fn object(&mut self, place: &str, at: u64, depth: usize) -> Result<(), Refusal> {
        if !self.visited.insert(at) {
            return Err(self.unaccepted(place, "more than one link to it"));
        }
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
        for (kind, name) in
            [(0x01, "extents"), (0x03, "types"), (0x08, "layouts"), (0x0B, "pipelines"), (0x11, "symbol tables")]
        {
            if messages.iter().filter(|message| message.kind == kind).count() > 1 {
                return Err(self.unaccepted(place, format!("two {name}")));
            }
        }
        // What has members is a group to libhdf5, whatever else it is; nothing may hide behind a layout.
        if find(0x08).is_some() && messages.iter().any(|message| matches!(message.kind, 0x02 | 0x06 | 0x0A | 0x11)) {
            return Err(self.unaccepted(place, "members though it is a data set"));
        }
        if let Some(layout) = find(0x08) {
            let (Some(space), Some(kind)) = (find(0x01), find(0x03)) else {
                return Err(self.damaged(place, at, "a data set without extent or type"));
            };
            let data_set = self.data_set(place, space, kind, layout, find(0x0B))?;
            self.structure.data_sets.insert(place.to_owned(), data_set);
            return Ok(());
        }
        // The names of a group can be filtered, too: looking one up would load a plug-in.
        if find(0x0B).is_some() {
            return Err(self.unaccepted(place, "a filter pipeline though it is a group"));
        }
        if find(0x03).is_some() {
            return Err(self.unaccepted(place, "a named data type"));
        }
        self.structure.groups.insert(place.to_owned());
        let mut children = Vec::new();
        for message in &messages {
            match message.kind {
                0x06 => children.push(self.link(place, message)?),
                0x11 => self.symbol_table(place, message, &mut children)?,
                _ => {}
            }
        }
        let mut names = BTreeSet::new();
        for (name, child) in children {
            if name.is_empty() || name == "." || name.contains('/') || !names.insert(name.clone()) {
                return Err(self.unaccepted(place, format!("a member of the name {name:?}, or two of it")));
            }
            self.object(&format!("{place}/{name}"), child, depth + 1)?;
        }
        Ok(())
    }

    /// All messages of a header, continuations included.
    fn messages(&self, place: &str, at: u64) -> Result<Vec<Message>, Refusal> {
        let head = self.bytes(place, at, 16)?;
        let mut messages = Vec::new();
        // Blocks of messages still to be read, and the width of what stands before each message.
        let mut blocks = Vec::new();
        let is_new = head.starts_with(b"OHDR");
        let mut creation_order = 0;
        if is_new {
            if head[4] != 2 {
                return Err(self.unaccepted(place, format!("object header version {}", head[4])));
            }
            let flags = head[5];
            creation_order = usize::from(flags & 4 != 0) * 2;
            let before = 6 + u64::from(flags & 0x20 != 0) * 16 + u64::from(flags & 0x10 != 0) * 4;
            let width = 1_u64 << (flags & 3);
            let size = self.bytes(place, at + before, width)?;
            let size = numbers(&size).number(width as usize).unwrap_or(UNDEFINED);
            blocks.push((at + before + width, size));
        } else {
            if head[0] != 1 {
                return Err(self.damaged(place, at, "there is no object header"));
            }
            blocks.push((at + 16, numbers(&head[8..]).number(4).unwrap_or(0)));
        }
        let mut total = 0_u64;
        while let Some((start, size)) = blocks.pop() {
            total = total.saturating_add(size);
            if total > LARGEST_HEADER {
                return Err(self.unaccepted(place, "a header of more than 4 MiB"));
            }
            let block = self.bytes(place, start, size)?;
            let mut cursor = numbers(&block);
            let head_width = if is_new { 4 + creation_order } else { 8 };
            while cursor.at + head_width <= block.len() {
                let torn = || self.damaged(place, start, "a header message is torn");
                let kind = cursor.number(if is_new { 1 } else { 2 }).ok_or_else(torn)? as u16;
                let width = cursor.number(2).ok_or_else(torn)? as usize;
                let flags = cursor.number(1).ok_or_else(torn)? as u8;
                cursor.skip(if is_new { creation_order } else { 3 }).ok_or_else(torn)?;
                let from = cursor.at;
                cursor.skip(width).ok_or_else(torn)?;
                let data = block[from..from + width].to_vec();
                if kind == 0x10 {
                    let mut place_of = numbers(&data);
                    let (next, size) = place_of.number(8).zip(place_of.number(8)).ok_or_else(torn)?;
                    // New blocks begin with a signature and end with a checksum.
                    let (skip, end) = if is_new { (4, 4) } else { (0, 0) };
                    let inner = size.checked_sub(skip + end).ok_or_else(torn)?;
                    blocks.push((next.checked_add(skip).ok_or_else(torn)?, inner));
                }
                messages.push(Message { kind, flags, at: start + from as u64, data });
                if messages.len() > MOST_MESSAGES {
                    return Err(self.unaccepted(place, "a header of very many messages"));
                }
            }
        }
        Ok(messages)
    }

    /// Refuses messages that are not on the list.
    fn check(&self, place: &str, message: &Message) -> Result<(), Refusal> {
        if message.flags & 2 != 0 && message.kind != 0 {
            return Err(self.unaccepted(place, "a shared header message or a named data type"));
        }
        let dense = |skip: usize| {
            let mut cursor = numbers(&message.data);
            cursor.skip(skip).and_then(|()| cursor.number(8))
        };
        match message.kind {
            // Nothing, extent, type, fill values, link, layout, group info, attribute, comment, times, continuation,
            // symbol table, B-tree sizes, reference count.
            0x00 | 0x01 | 0x03..=0x06 | 0x08 | 0x0A | 0x0C..=0x0E | 0x10..=0x13 | 0x16 => Ok(()),
            0x02 | 0x15 => {
                let flags = message.data.get(1).copied().unwrap_or(0);
                let index = if message.kind == 0x02 { 8 } else { 2 };
                let skip = 2 + usize::from(flags & 1 != 0) * index;
                match dense(skip) {
                    Some(UNDEFINED) => Ok(()),
                    Some(_) if message.kind == 0x15 => Ok(()),
                    Some(_) => Err(self.unaccepted(
                        place,
                        "links in dense storage (write it with the earliest library version, or with at most 8 members a group)",
                    )),
                    None => Err(self.damaged(place, message.at, "a message is too short")),
                }
            }
            0x07 => Err(self.unaccepted(place, "external storage")),
            0x0B => self.filters(place, message).map(|_| ()),
            0x0F => Err(self.unaccepted(place, "a table of shared messages")),
            0x14 => Err(self.unaccepted(place, "driver information")),
            other => Err(self.unaccepted(place, format!("a header message of type {other}"))),
        }
    }

    /// Name and address of a hard link.
    fn link(&self, place: &str, message: &Message) -> Result<(String, u64), Refusal> {
        let torn = || self.damaged(place, message.at, "a link is torn");
        let mut cursor = numbers(&message.data);
        cursor.skip(1).ok_or_else(torn)?;
        let flags = cursor.number(1).ok_or_else(torn)?;
        let kind = if flags & 8 != 0 { cursor.number(1).ok_or_else(torn)? } else { 0 };
        cursor.skip(if flags & 4 != 0 { 8 } else { 0 }).ok_or_else(torn)?;
        cursor.skip(usize::from(flags & 0x10 != 0)).ok_or_else(torn)?;
        let width = cursor.number(1 << (flags & 3)).ok_or_else(torn)? as usize;
        let from = cursor.at;
        cursor.skip(width).ok_or_else(torn)?;
        let name = String::from_utf8_lossy(&message.data[from..from + width]).into_owned();
        match kind {
            0 => Ok((name, cursor.number(8).ok_or_else(torn)?)),
            1 => Err(self.unaccepted(&format!("{place}/{name}"), "a soft link")),
            64 => Err(self.unaccepted(&format!("{place}/{name}"), "an external link")),
            other => Err(self.unaccepted(&format!("{place}/{name}"), format!("a link of class {other}"))),
        }
    }

    fn symbol_table(&self, place: &str, message: &Message, found: &mut Vec<(String, u64)>) -> Result<(), Refusal> {
        let torn = || self.damaged(place, message.at, "the symbol table is torn");
        let mut cursor = numbers(&message.data);
        let (tree, heap) = cursor.number(8).zip(cursor.number(8)).ok_or_else(torn)?;
        let head = self.bytes(place, heap, 32)?;
        if !head.starts_with(b"HEAP") {
            return Err(self.damaged(place, heap, "there is no local heap"));
        }
        let size = numbers(&head[8..]).number(8).ok_or_else(torn)?;
        let data = numbers(&head[24..]).number(8).ok_or_else(torn)?;
        let names = self.bytes(place, data, size)?;
        let mut nodes = vec![(tree, 0)];
        let mut seen = BTreeSet::new();
        while let Some((at, depth)) = nodes.pop() {
            if !seen.insert(at) || depth > DEEPEST || seen.len() > MOST_OBJECTS {
                return Err(self.damaged(place, at, "the tree of the symbol table is no tree"));
            }
            let head = self.bytes(place, at, 8)?;
            if head.starts_with(b"SNOD") {
                let count = numbers(&head[6..]).number(2).ok_or_else(torn)?;
                let entries = self.bytes(place, at + 8, count * 40)?;
                for entry in entries.chunks_exact(40) {
                    found.push(self.symbol(place, at, entry, &names)?);
                }
                if found.len() > MOST_OBJECTS {
                    return Err(self.unaccepted(place, format!("more than {MOST_OBJECTS} members")));
                }
            } else if head.starts_with(b"TREE") {
                let count = numbers(&head[6..]).number(2).ok_or_else(torn)?;
                // Keys and children take turns, behind two addresses of siblings.
                let body = self.bytes(place, at + 24, count * 16 + 8)?;
                for k in 0..count as usize {
                    nodes.push((numbers(&body[16 * k + 8..]).number(8).ok_or_else(torn)?, depth + 1));
                }
            } else {
                return Err(self.damaged(place, at, "there is no node of a symbol table"));
            }
        }
        Ok(())
    }

    fn symbol(&self, place: &str, at: u64, entry: &[u8], names: &[u8]) -> Result<(String, u64), Refusal> {
        let torn = || self.damaged(place, at, "an entry of the symbol table is torn");
        let mut cursor = numbers(entry);
        let offset = cursor.number(8).ok_or_else(torn)? as usize;
        let header = cursor.number(8).ok_or_else(torn)?;
        let cached = cursor.number(4).ok_or_else(torn)?;
        let name = names.get(offset..).and_then(|rest| rest.split(|b| *b == 0).next()).ok_or_else(torn)?;
        let name = String::from_utf8_lossy(name).into_owned();
        match cached {
            0 | 1 => Ok((name, header)),
            2 => Err(self.unaccepted(&format!("{place}/{name}"), "a soft link")),
            other => Err(self.unaccepted(&format!("{place}/{name}"), format!("a link of class {other}"))),
        }
    }
}

fn shown(place: &str) -> String {
    if place.is_empty() { "the file".to_owned() } else { place.to_owned() }
}

#[cfg(test)]
mod tests;
