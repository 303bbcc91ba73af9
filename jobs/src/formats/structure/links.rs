//! Links of groups in messages and in symbol tables.

use super::header::Message;
use super::{Bytes, DEEPEST, MOST_OBJECTS, Reader, Refusal, numbers};
use std::collections::BTreeSet;

/// Name of a member of a group, and address of its header; None for soft links, which are not followed.
pub(super) type Member = (String, Option<u64>);

impl<B: Bytes + ?Sized> Reader<'_, B> {
    /// The member of a group that a link message names.
    pub(super) fn link(&self, place: &str, at: u64, data: &[u8]) -> Result<Member, Refusal> {
        let torn = || self.damaged(place, at, "a link is torn");
        let mut cursor = numbers(data);
        cursor.skip(1).ok_or_else(torn)?;
        let flags = cursor.number(1).ok_or_else(torn)?;
        let kind = if flags & 8 != 0 { cursor.number(1).ok_or_else(torn)? } else { 0 };
        cursor.skip(if flags & 4 != 0 { 8 } else { 0 }).ok_or_else(torn)?;
        cursor.skip(usize::from(flags & 0x10 != 0)).ok_or_else(torn)?;
        let width = cursor.number(1 << (flags & 3)).ok_or_else(torn)? as usize;
        let from = cursor.at;
        cursor.skip(width).ok_or_else(torn)?;
        let name = String::from_utf8_lossy(&data[from..from + width]).into_owned();
        match kind {
            0 => Ok((name, Some(cursor.number(8).ok_or_else(torn)?))),
            1 => Ok((name, None)),
            64 => {
                Err(self.unaccepted(&format!("{place}/{name}"), "an external link (copy what it names into this file)"))
            }
            other => Err(self.unaccepted(&format!("{place}/{name}"), format!("a link of class {other}"))),
        }
    }

    pub(super) fn symbol_table(&self, place: &str, message: &Message, found: &mut Vec<Member>) -> Result<(), Refusal> {
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

    fn symbol(&self, place: &str, at: u64, entry: &[u8], names: &[u8]) -> Result<Member, Refusal> {
        let torn = || self.damaged(place, at, "an entry of the symbol table is torn");
        let mut cursor = numbers(entry);
        let offset = cursor.number(8).ok_or_else(torn)? as usize;
        let header = cursor.number(8).ok_or_else(torn)?;
        let cached = cursor.number(4).ok_or_else(torn)?;
        let name = names.get(offset..).and_then(|rest| rest.split(|b| *b == 0).next()).ok_or_else(torn)?;
        let name = String::from_utf8_lossy(name).into_owned();
        match cached {
            0 | 1 => Ok((name, Some(header))),
            2 => Ok((name, None)),
            other => Err(self.unaccepted(&format!("{place}/{name}"), format!("a link of class {other}"))),
        }
    }
}
