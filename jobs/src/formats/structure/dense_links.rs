//! Links in dense storage: link messages in a fractal heap, listed by a version 2 tree over the hashes of their names.

use super::header::Message;
use super::links::Member;
use super::{Bytes, MOST_OBJECTS, Reader, Refusal, UNDEFINED, numbers};

/// Type of a tree over the names of links.
const NAMES: u8 = 5;
/// Bytes of a hash, before the place of the link in the heap.
const HASH: usize = 4;

impl<B: Bytes + ?Sized> Reader<'_, B> {
    /// Adds the links that a table of links names; none where they are compact.
    pub(super) fn dense_links(&self, place: &str, message: &Message, found: &mut Vec<Member>) -> Result<(), Refusal> {
        let torn = || self.damaged(place, message.at, "the table of links is too short");
        let mut cursor = numbers(&message.data);
        cursor.skip(1).ok_or_else(torn)?;
        let flags = cursor.number(1).ok_or_else(torn)?;
        cursor.skip(if flags & 1 != 0 { 8 } else { 0 }).ok_or_else(torn)?;
        let (heap, tree) = cursor.number(8).zip(cursor.number(8)).ok_or_else(torn)?;
        if heap == UNDEFINED {
            return Ok(());
        }
        let mut heap = self.fractal_heap(place, heap)?;
        for record in self.records(place, tree, &[NAMES], MOST_OBJECTS as u64)? {
            let id = record.get(HASH..).ok_or_else(torn)?;
            let (at, link) = self.heap_object(place, &mut heap, id)?;
            found.push(self.link(place, at, &link)?);
        }
        Ok(())
    }
}
