//! Version 2 trees: the records of all nodes, from the root down.

use super::{Bytes, DEEPEST, MOST_NODES, Reader, Refusal, SUM, UNDEFINED, numbers};
use std::collections::BTreeSet;

/// Bytes of a node beside its records: signature, version, type, check sum.
const AROUND: u64 = 10;
/// Bytes of a header before its check sum.
const HEAD: u64 = 34;
/// Bytes of a node before its records.
const BEFORE: u64 = 6;

/// What the header of a tree says of its nodes.
struct Shape {
    /// Bytes of a node.
    node: u64,
    /// Bytes of a record.
    record: u64,
    /// Bytes of a count of records in one node.
    count: usize,
    /// Bytes of a count of records in a node of each depth and everything below it.
    total: Vec<usize>,
}

impl Shape {
    /// None where no node has room for a record.
    fn new(node: u64, record: u64, depth: usize) -> Option<Self> {
        let in_leaf = node.checked_sub(AROUND)?.checked_div(record).filter(|most| *most > 0)?;
        let count = width(in_leaf);
        let (mut total, mut below) = (vec![0], in_leaf);
        for level in 1..=depth {
            let pointer = 8 + count as u64 + total[level - 1] as u64;
            let most = node.checked_sub(AROUND + pointer)?.checked_div(record + pointer).filter(|most| *most > 0)?;
            below = (most + 1).saturating_mul(below).saturating_add(most);
            total.push(width(below));
        }
        Some(Self { node, record, count, total })
    }
}

/// Bytes that a number up to `most` takes.
pub(super) fn width(most: u64) -> usize {
    most.max(1).ilog2() as usize / 8 + 1
}

impl<B: Bytes + ?Sized> Reader<'_, B> {
    /// All records of a tree of one of some types, at most so many.
    pub(super) fn records(&self, place: &str, at: u64, types: &[u8], most: u64) -> Result<Vec<Vec<u8>>, Refusal> {
        let torn = |at: u64| self.damaged(place, at, "a version 2 tree is torn");
        let head = self.sealed(place, at, HEAD)?;
        if !head.starts_with(b"BTHD") || head[4] != 0 || !types.contains(&head[5]) {
            return Err(torn(at));
        }
        let number = |from: usize, width: usize| numbers(&head[from..]).number(width).ok_or_else(|| torn(at));
        let (node, record, depth) = (number(6, 4)?, number(10, 2)?, number(12, 2)? as usize);
        let (root, count, total) = (number(16, 8)?, number(24, 2)?, number(26, 8)?);
        if total > most {
            return Err(self.unaccepted(place, format!("a tree of {total} records, where at most {most} can be")));
        }
        if root == UNDEFINED || total == 0 {
            return Ok(Vec::new());
        }
        if depth > DEEPEST {
            return Err(torn(at));
        }
        let shape = Shape::new(node, record, depth).ok_or_else(|| torn(at))?;
        let mut found = Vec::new();
        let (mut nodes, mut seen) = (vec![(root, count, depth)], BTreeSet::new());
        while let Some((at, count, depth)) = nodes.pop() {
            if !seen.insert(at) || seen.len() > MOST_NODES {
                return Err(torn(at));
            }
            self.tree_node(place, (at, count, depth), &shape, &mut found, &mut nodes)?;
            if found.len() as u64 > total {
                return Err(torn(at));
            }
        }
        if found.len() as u64 == total { Ok(found) } else { Err(torn(at)) }
    }

    /// Reads a node at an address, with so many records and so many levels below it.
    fn tree_node(
        &self,
        place: &str,
        (at, count, depth): (u64, u64, usize),
        shape: &Shape,
        found: &mut Vec<Vec<u8>>,
        nodes: &mut Vec<(u64, u64, usize)>,
    ) -> Result<(), Refusal> {
        let torn = || self.damaged(place, at, "a node of a version 2 tree is torn");
        let signature = if depth == 0 { b"BTLF" } else { b"BTIN" };
        let pointer = 8 + shape.count + depth.checked_sub(1).map_or(0, |below| shape.total[below]);
        let pointers = if depth == 0 { 0 } else { (count + 1) * pointer as u64 };
        let size = BEFORE + count * shape.record + pointers;
        if size > shape.node - SUM {
            return Err(torn());
        }
        let node = self.sealed(place, at, size)?;
        if !node.starts_with(signature) {
            return Err(torn());
        }
        let (records, children) = node[BEFORE as usize..].split_at((count * shape.record) as usize);
        found.extend(records.chunks_exact(shape.record as usize).map(<[u8]>::to_vec));
        for child in children.chunks_exact(pointer) {
            let mut cursor = numbers(child);
            let (at, count) = cursor.number(8).zip(cursor.number(shape.count)).ok_or_else(torn)?;
            nodes.push((at, count, depth - 1));
        }
        Ok(())
    }
}
