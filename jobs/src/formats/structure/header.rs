//! Object headers of versions 1 and 2: their messages, and which of them are accepted.

use super::{Bytes, LARGEST_HEADER, MOST_MESSAGES, Reader, Refusal, UNDEFINED, numbers};

/// A header message.
pub(super) struct Message {
    /// Type of the message.
    pub kind: u16,
    /// Flags: bit 1 is of shared messages.
    pub flags: u8,
    /// Where its data begin in the file.
    pub at: u64,
    /// Its data.
    pub data: Vec<u8>,
}

impl<B: Bytes + ?Sized> Reader<'_, B> {
    /// All messages of a header, continuations included.
    pub(super) fn messages(&self, place: &str, at: u64) -> Result<Vec<Message>, Refusal> {
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
    pub(super) fn check(&self, place: &str, message: &Message) -> Result<(), Refusal> {
        if message.flags & 2 != 0 && message.kind != 0 {
            return Err(self.unaccepted(place, "a shared header message or a named data type"));
        }
        match message.kind {
            // Nothing, extent, table of links, type, fill values, link, layout, group info, attribute, comment, times,
            // continuation, symbol table, B-tree sizes, table of attributes, reference count.
            0x00..=0x06 | 0x08 | 0x0A | 0x0C..=0x0E | 0x10..=0x13 | 0x15 | 0x16 => Ok(()),
            0x07 => Err(self.unaccepted(place, "external storage")),
            0x0B => self.filters(place, message).map(|_| ()),
            0x0F => Err(self.unaccepted(place, "a table of shared messages")),
            0x14 => Err(self.unaccepted(place, "driver information")),
            other => Err(self.unaccepted(place, format!("a header message of type {other}"))),
        }
    }

    /// Refuses an extension of the superblock that changes how the rest is to be read.
    pub(super) fn check_extension(&self, at: u64) -> Result<(), Refusal> {
        for message in self.messages("", at)? {
            // Nothing, continuation, B-tree sizes, file space.
            if !matches!(message.kind, 0x00 | 0x10 | 0x13 | 0x17) {
                let what = format!("a superblock extension with a message of type {}", message.kind);
                return Err(self.unaccepted("", what));
            }
        }
        Ok(())
    }
}
