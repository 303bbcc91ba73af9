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

/// A block of messages: where its check sum begins, where the messages begin, and their bytes.
struct Block {
    from: u64,
    start: u64,
    size: u64,
}

/// How messages stand in a block.
struct Form {
    /// Whether the header has version 2.
    is_new: bool,
    /// Bytes of the order of creation before each message.
    creation_order: usize,
}

impl Form {
    /// Bytes before a message.
    fn head(&self) -> usize {
        if self.is_new { 4 + self.creation_order } else { 8 }
    }

    /// The block that a message leads to. New ones begin with a signature and end with a check sum.
    fn continuation(&self, data: &[u8]) -> Option<Block> {
        let mut cursor = numbers(data);
        let (from, size) = cursor.number(8).zip(cursor.number(8))?;
        let (signature, sum) = if self.is_new { (4, 4) } else { (0, 0) };
        Some(Block { from, start: from.checked_add(signature)?, size: size.checked_sub(signature + sum)? })
    }
}

impl<B: Bytes + ?Sized> Reader<'_, B> {
    /// All messages of a header, continuations included.
    pub(super) fn messages(&self, place: &str, at: u64) -> Result<Vec<Message>, Refusal> {
        let (first, form) = self.first_block(place, at)?;
        let (mut messages, mut blocks, mut total) = (Vec::new(), vec![first], 0_u64);
        while let Some(Block { from, start, size }) = blocks.pop() {
            total = total.saturating_add(size);
            if total > LARGEST_HEADER {
                return Err(self.unaccepted(place, "a header of more than 4 MiB"));
            }
            if form.is_new {
                self.sealed(place, from, size + (start - from))?;
            }
            let block = self.bytes(place, start, size)?;
            let mut cursor = numbers(&block);
            while cursor.at + form.head() <= block.len() {
                let torn = || self.damaged(place, start, "a header message is torn");
                let kind = cursor.number(if form.is_new { 1 } else { 2 }).ok_or_else(torn)? as u16;
                let width = cursor.number(2).ok_or_else(torn)? as usize;
                let flags = cursor.number(1).ok_or_else(torn)? as u8;
                cursor.skip(if form.is_new { form.creation_order } else { 3 }).ok_or_else(torn)?;
                let from = cursor.at;
                cursor.skip(width).ok_or_else(torn)?;
                let data = block[from..from + width].to_vec();
                if kind == 0x10 {
                    blocks.push(form.continuation(&data).ok_or_else(torn)?);
                }
                messages.push(Message { kind, flags, at: start + from as u64, data });
                if messages.len() > MOST_MESSAGES {
                    return Err(self.unaccepted(place, "a header of very many messages"));
                }
            }
        }
        Ok(messages)
    }

    /// The block of messages with which a header begins.
    fn first_block(&self, place: &str, at: u64) -> Result<(Block, Form), Refusal> {
        let head = self.bytes(place, at, 16)?;
        if !head.starts_with(b"OHDR") {
            if head[0] != 1 {
                return Err(self.damaged(place, at, "there is no object header"));
            }
            let block = Block { from: at, start: at + 16, size: numbers(&head[8..]).number(4).unwrap_or(0) };
            return Ok((block, Form { is_new: false, creation_order: 0 }));
        }
        if head[4] != 2 {
            return Err(self.unaccepted(place, format!("object header version {}", head[4])));
        }
        let flags = head[5];
        let before = 6 + u64::from(flags & 0x20 != 0) * 16 + u64::from(flags & 0x10 != 0) * 4;
        let width = 1_u64 << (flags & 3);
        let size = self.bytes(place, at + before, width)?;
        let size = numbers(&size).number(width as usize).unwrap_or(UNDEFINED);
        let form = Form { is_new: true, creation_order: usize::from(flags & 4 != 0) * 2 };
        Ok((Block { from: at, start: at + before + width, size }, form))
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
            0x07 => Err(self.unaccepted(place, "external storage (h5repack writes its numbers into the file)")),
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
