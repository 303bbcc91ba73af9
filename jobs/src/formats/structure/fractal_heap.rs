//! Fractal heaps: where an object lies in the doubling table of blocks. Only managed objects are read: links are never tiny,
//! and huge ones have names of more than 4,000 bytes.

use super::tree_2::width;
use super::{Bytes, DEEPEST, LARGEST_BLOCK, Reader, Refusal, SUM, UNDEFINED, numbers};
use std::collections::BTreeSet;

/// Bytes of a block before its offset: signature, version, address of the header.
const BEFORE: u64 = 13;

/// What the header of a heap says of its blocks.
pub(super) struct Heap {
    /// Address of the header.
    at: u64,
    /// Blocks of a row.
    width: u64,
    /// Bytes of a block of the first two rows; each row after has blocks twice as large.
    start: u64,
    /// Bytes of a block with objects at most; larger ones are tables of blocks.
    largest: u64,
    /// Bytes of an offset in the heap.
    offset: usize,
    /// Bytes of the length of an object.
    length: usize,
    /// Address of the root.
    root: u64,
    /// Rows of the root; 0 where it is a block with objects.
    rows: u64,
    /// Whether blocks with objects have check sums.
    has_sums: bool,
    /// Blocks whose check sums were compared.
    checked: BTreeSet<u64>,
}

impl Heap {
    /// Bytes of a block of a row.
    fn block(&self, row: u64) -> u64 {
        let doublings = u32::try_from(row.saturating_sub(1)).unwrap_or(u32::MAX);
        self.start.checked_shl(doublings).filter(|size| size >> doublings.min(63) == self.start).unwrap_or(u64::MAX)
    }

    /// Where a row begins in a table.
    fn row_start(&self, row: u64) -> u64 {
        if row == 0 { 0 } else { self.width.saturating_mul(self.block(row)) }
    }
}

impl<B: Bytes + ?Sized> Reader<'_, B> {
    /// Reads the header of a heap.
    pub(super) fn fractal_heap(&self, place: &str, at: u64) -> Result<Heap, Refusal> {
        let torn = || self.damaged(place, at, "the heap of its links is torn");
        let head = self.sealed(place, at, 142)?;
        let number = |from: usize, width: usize| numbers(&head[from..]).number(width).ok_or_else(torn);
        if !head.starts_with(b"FRHP") || head[4] != 0 {
            return Err(torn());
        }
        if number(7, 2)? != 0 {
            return Err(self.unaccepted(place, "filters on the heap of its links"));
        }
        let (most, largest, bits) = (number(10, 4)?, number(120, 8)?, number(128, 2)?);
        let heap = Heap {
            at,
            width: number(110, 2)?,
            start: number(112, 8)?,
            largest,
            offset: (bits as usize).div_ceil(8),
            length: (largest.max(1).ilog2() as usize).div_ceil(8).min(width(most)),
            root: number(132, 8)?,
            rows: number(140, 2)?,
            has_sums: head[9] & 2 != 0,
            checked: BTreeSet::new(),
        };
        let is_sound = heap.width.is_power_of_two()
            && heap.start.is_power_of_two()
            && heap.largest.is_power_of_two()
            && heap.start <= heap.largest
            && heap.largest <= LARGEST_BLOCK
            && heap.width <= 1 << 10
            && (1..=64).contains(&bits)
            && heap.rows <= 64
            && heap.root != UNDEFINED;
        if is_sound { Ok(heap) } else { Err(torn()) }
    }

    /// An object of a heap by its id, with its address in the file.
    pub(super) fn heap_object(&self, place: &str, heap: &mut Heap, id: &[u8]) -> Result<(u64, Vec<u8>), Refusal> {
        let header = heap.at;
        let torn = || self.damaged(place, header, "the heap of its links is torn");
        let mut cursor = numbers(id);
        let kind = cursor.number(1).ok_or_else(torn)?;
        if kind != 0 {
            return Err(self.unaccepted(place, "a link with a name of more than 4,000 bytes"));
        }
        let (mut offset, length) = cursor.number(heap.offset).zip(cursor.number(heap.length)).ok_or_else(torn)?;
        // From table to table down to a block with objects.
        let (mut at, mut rows, mut size) = (heap.root, heap.rows, heap.start);
        let mut is_table = heap.rows > 0;
        for _ in 0..DEEPEST {
            if !is_table {
                self.check_block(place, at, size, heap)?;
                if offset.checked_add(length).is_none_or(|end| end > size) {
                    return Err(torn());
                }
                let at = at.checked_add(offset).ok_or_else(torn)?;
                return Ok((at, self.bytes(place, at, length)?));
            }
            let table = BEFORE + heap.offset as u64 + 8 * rows * heap.width;
            let table =
                if heap.checked.insert(at) { self.sealed(place, at, table)? } else { self.bytes(place, at, table)? };
            let row = (0..rows).rev().find(|row| heap.row_start(*row) <= offset).ok_or_else(torn)?;
            size = heap.block(row);
            let column = (offset - heap.row_start(row)) / size;
            if column >= heap.width || !table.starts_with(b"FHIB") {
                return Err(torn());
            }
            offset -= heap.row_start(row) + column * size;
            let entry = BEFORE as usize + heap.offset + 8 * (row * heap.width + column) as usize;
            at = table.get(entry..).and_then(|entry| numbers(entry).number(8)).ok_or_else(torn)?;
            is_table = size > heap.largest;
            if is_table {
                let first_rows = heap.start.saturating_mul(heap.width);
                rows = (size / first_rows).checked_ilog2().map_or(0, |rows| u64::from(rows) + 1);
            }
        }
        Err(torn())
    }

    /// Checks a block with objects: its beginning, and its check sum, which counts as zeros where it stands.
    fn check_block(&self, place: &str, at: u64, size: u64, heap: &mut Heap) -> Result<(), Refusal> {
        if !heap.checked.insert(at) {
            return Ok(());
        }
        let torn = || self.damaged(place, at, "a block of the heap of its links is torn");
        let mut block = self.bytes(place, at, size)?;
        if !block.starts_with(b"FHDB") {
            return Err(torn());
        }
        if heap.has_sums {
            let from = BEFORE as usize + heap.offset;
            let sum = block.get_mut(from..from + SUM as usize).ok_or_else(torn)?;
            let found = sum.to_vec();
            sum.fill(0);
            self.check_sum(place, at, &block, &found)?;
        }
        Ok(())
    }
}
