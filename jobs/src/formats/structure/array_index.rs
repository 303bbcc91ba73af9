//! Indexes of chunks that are arrays: of fixed length, and extensible ones, whose blocks double.

use super::chunk_index::{Entry, Grid};
use super::{Bytes, Reader, Refusal, SUM, UNDEFINED, numbers};

/// Bytes before the rest of each block: signature, version, client, address of the header.
const BEFORE: u64 = 14;

/// What the header of an array says of its entries.
struct Shape {
    /// Bytes of an entry.
    entry: u64,
    /// Entries of a page, where a block has more of them.
    page: u64,
}

/// What the header of an extensible array says of its blocks.
struct Blocks {
    /// Entries of the smallest block.
    smallest: u64,
    /// Super blocks whose blocks the index block names.
    named: u64,
    /// Number of super blocks.
    supers: u64,
    /// Bytes of an offset in the array.
    offset: u64,
}

/// Entries so far, None for chunks that were never written, and how many are wanted.
struct Found {
    entries: Vec<Option<Entry>>,
    needed: u64,
}

impl Found {
    fn is_full(&self) -> bool {
        self.entries.len() as u64 >= self.needed
    }

    /// Passes over entries that were never written.
    fn skip(&mut self, count: u64) {
        let length = (self.entries.len() as u64).saturating_add(count).min(self.needed);
        self.entries.resize(length as usize, None);
    }
}

impl<B: Bytes + ?Sized> Reader<'_, B> {
    fn shape(&self, entry: u64, page_bits: u64) -> Option<Shape> {
        (entry >= 8 && page_bits < 32).then(|| Shape { entry, page: 1 << page_bits })
    }

    /// The first entries of an array of fixed length.
    pub(super) fn fixed_array(
        &self,
        place: &str,
        at: u64,
        needed: u64,
        grid: &Grid,
    ) -> Result<Vec<Option<Entry>>, Refusal> {
        let torn = || self.damaged(place, at, "the array of its chunks is torn");
        let head = self.sealed(place, at, 24)?;
        let count = numbers(&head[8..]).number(8).ok_or_else(torn)?;
        let block = numbers(&head[16..]).number(8).ok_or_else(torn)?;
        if !head.starts_with(b"FAHD") || head[4] != 0 || count < needed {
            return Err(torn());
        }
        let shape = self.shape(u64::from(head[6]), u64::from(head[7])).ok_or_else(torn)?;
        let mut found = Found { entries: Vec::new(), needed };
        if block == UNDEFINED {
            return Ok(found.entries);
        }
        let is_paged = count > shape.page;
        let mask = if is_paged { count.div_ceil(shape.page).div_ceil(8) } else { 0 };
        let body = if is_paged { mask } else { count.saturating_mul(shape.entry) };
        let bytes = self.sealed(place, block, BEFORE.saturating_add(body))?;
        if !bytes.starts_with(b"FADB") {
            return Err(torn());
        }
        let body = &bytes[BEFORE as usize..];
        if is_paged {
            let pages = block.checked_add(BEFORE + mask + SUM).ok_or_else(torn)?;
            self.pages(place, (pages, count), body, &shape, grid, &mut found)?;
        } else {
            self.entries(place, block, body, &shape, grid, &mut found)?;
        }
        Ok(found.entries)
    }

    /// The first entries of an extensible array.
    pub(super) fn extensible_array(
        &self,
        place: &str,
        at: u64,
        needed: u64,
        grid: &Grid,
    ) -> Result<Vec<Option<Entry>>, Refusal> {
        let torn = || self.damaged(place, at, "the array of its chunks is torn");
        let head = self.sealed(place, at, 68)?;
        if !head.starts_with(b"EAHD") || head[4] != 0 {
            return Err(torn());
        }
        let [entry, bits, in_index, smallest, pointers, page] = [6, 7, 8, 9, 10, 11].map(|k: usize| u64::from(head[k]));
        let index = numbers(&head[60..]).number(8).ok_or_else(torn)?;
        let shape = self.shape(entry, page).ok_or_else(torn)?;
        let levels = smallest.checked_ilog2().and_then(|least| bits.checked_sub(u64::from(least))).ok_or_else(torn)?;
        if !smallest.is_power_of_two() || !pointers.is_power_of_two() || bits > 64 {
            return Err(torn());
        }
        let named = 2 * u64::from(pointers.ilog2());
        let blocks = Blocks { smallest, named, supers: levels + 1, offset: bits.div_ceil(8) };
        let mut found = Found { entries: Vec::new(), needed };
        if index == UNDEFINED {
            return Ok(found.entries);
        }
        let named_blocks: u64 = (0..named.min(blocks.supers)).map(|level| 1_u64 << (level / 2)).sum();
        let addresses = named_blocks + blocks.supers.saturating_sub(named);
        let size = BEFORE + in_index * shape.entry + 8 * addresses;
        let bytes = self.sealed(place, index, size)?;
        if !bytes.starts_with(b"EAIB") {
            return Err(torn());
        }
        let (own, addresses) = bytes[BEFORE as usize..].split_at((in_index * shape.entry) as usize);
        self.entries(place, index, own, &shape, grid, &mut found)?;
        let mut addresses = addresses.as_chunks::<8>().0.iter().map(|bytes| u64::from_le_bytes(*bytes));
        for level in 0..blocks.supers {
            if found.is_full() {
                break;
            }
            let (count, length) = (1_u64 << (level / 2), blocks.smallest << level.div_ceil(2));
            if level < blocks.named {
                for address in addresses.by_ref().take(count as usize) {
                    self.data_block(place, (address, length), &[], (&shape, &blocks), grid, &mut found)?;
                }
            } else {
                let address = addresses.next().ok_or_else(torn)?;
                self.super_block(place, (address, count, length), (&shape, &blocks), grid, &mut found)?;
            }
        }
        Ok(found.entries)
    }

    /// A super block at an address, with so many blocks of so many entries each.
    fn super_block(
        &self,
        place: &str,
        (at, count, length): (u64, u64, u64),
        (shape, blocks): (&Shape, &Blocks),
        grid: &Grid,
        found: &mut Found,
    ) -> Result<(), Refusal> {
        if at == UNDEFINED {
            found.skip(count.saturating_mul(length));
            return Ok(());
        }
        let torn = || self.damaged(place, at, "the array of its chunks is torn");
        // A mask of the pages that were written, for each block that has pages.
        let mask = if length > shape.page { (length / shape.page).div_ceil(8) } else { 0 };
        let size = count.saturating_mul(mask + 8).saturating_add(BEFORE + blocks.offset);
        let bytes = self.sealed(place, at, size)?;
        if !bytes.starts_with(b"EASB") {
            return Err(torn());
        }
        let (masks, addresses) = bytes[(BEFORE + blocks.offset) as usize..].split_at((count * mask) as usize);
        for (k, address) in addresses.as_chunks::<8>().0.iter().enumerate() {
            if found.is_full() {
                break;
            }
            let written = &masks[k * mask as usize..(k + 1) * mask as usize];
            self.data_block(place, (u64::from_le_bytes(*address), length), written, (shape, blocks), grid, found)?;
        }
        Ok(())
    }

    /// A data block at an address, with so many entries.
    fn data_block(
        &self,
        place: &str,
        (at, length): (u64, u64),
        written: &[u8],
        (shape, blocks): (&Shape, &Blocks),
        grid: &Grid,
        found: &mut Found,
    ) -> Result<(), Refusal> {
        if at == UNDEFINED {
            found.skip(length);
            return Ok(());
        }
        let torn = || self.damaged(place, at, "the array of its chunks is torn");
        let is_paged = length > shape.page;
        let body = if is_paged { 0 } else { length * shape.entry };
        let bytes = self.sealed(place, at, BEFORE + blocks.offset + body)?;
        if !bytes.starts_with(b"EADB") {
            return Err(torn());
        }
        let body = &bytes[(BEFORE + blocks.offset) as usize..];
        if !is_paged {
            return self.entries(place, at, body, shape, grid, found);
        }
        let pages = at.checked_add(BEFORE + blocks.offset + SUM).ok_or_else(torn)?;
        self.pages(place, (pages, length), written, shape, grid, found)
    }

    /// Entries in pages, of which those that were never written are marked by a 0.
    fn pages(
        &self,
        place: &str,
        (mut at, mut count): (u64, u64),
        written: &[u8],
        shape: &Shape,
        grid: &Grid,
        found: &mut Found,
    ) -> Result<(), Refusal> {
        let mut page = 0;
        while count > 0 && !found.is_full() {
            let here = count.min(shape.page);
            let torn = || self.damaged(place, at, "the array of its chunks is torn");
            let mask = written.get(page / 8).ok_or_else(torn)?;
            if mask & 0x80 >> (page % 8) == 0 {
                found.skip(here);
            } else {
                let bytes = self.sealed(place, at, here * shape.entry)?;
                self.entries(place, at, &bytes, shape, grid, found)?;
            }
            at = at.checked_add(shape.page * shape.entry + SUM).ok_or_else(torn)?;
            count -= here;
            page += 1;
        }
        Ok(())
    }

    /// Entries one after another in a block at an address; no more than are wanted.
    fn entries(
        &self,
        place: &str,
        at: u64,
        bytes: &[u8],
        shape: &Shape,
        grid: &Grid,
        found: &mut Found,
    ) -> Result<(), Refusal> {
        let wanted = found.needed - found.entries.len() as u64;
        for bytes in bytes.chunks_exact(shape.entry as usize).take(wanted as usize) {
            let torn = || self.damaged(place, at, "the array of its chunks is torn");
            let entry = self.entry(bytes, grid).ok_or_else(torn)?;
            found.entries.push((entry.at != UNDEFINED).then_some(entry));
        }
        Ok(())
    }
}
