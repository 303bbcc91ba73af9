//! Filters of chunks, undone in the order against that of writing.

use super::checksum::fletcher_32;
use flate2::read::ZlibDecoder;
use std::io::Read;

/// Numbers of the filters.
const DEFLATE: u16 = 1;
const SHUFFLE: u16 = 2;
const FLETCHER_32: u16 = 3;
/// Bytes that a filter may add to a chunk: the check sum, and what deflate needs for what it cannot make smaller.
const SLACK: u64 = 1 << 12;

/// Undoes filters. Bit k of `skipped` is of the filter k that was not applied to this chunk. A chunk has `size` bytes
/// without its filters.
///
/// # Errors
/// What is wrong with the chunk.
pub(super) fn undo(
    mut bytes: Vec<u8>,
    filters: &[u16],
    skipped: u64,
    element_bytes: u64,
    size: u64,
) -> Result<Vec<u8>, &'static str> {
    for (k, filter) in filters.iter().enumerate().rev() {
        if skipped >> k & 1 == 1 {
            continue;
        }
        bytes = match *filter {
            DEFLATE => inflate(&bytes, size + size / 64 + SLACK)?,
            SHUFFLE => unshuffle(&bytes, element_bytes as usize),
            FLETCHER_32 => checked(bytes)?,
            _ => return Err("a chunk has an unknown filter"),
        };
    }
    if bytes.len() as u64 == size { Ok(bytes) } else { Err("a chunk has another size than its extent says") }
}

fn inflate(bytes: &[u8], most: u64) -> Result<Vec<u8>, &'static str> {
    let mut found = Vec::new();
    ZlibDecoder::new(bytes).take(most + 1).read_to_end(&mut found).map_err(|_| "a compressed chunk is damaged")?;
    if found.len() as u64 > most { Err("a chunk inflates beyond its extent") } else { Ok(found) }
}

/// Bytes of the same rank lay together; those that fill no element are at the end as they were.
fn unshuffle(bytes: &[u8], width: usize) -> Vec<u8> {
    let count = bytes.len().checked_div(width).unwrap_or(0);
    if width < 2 || count < 2 {
        return bytes.to_vec();
    }
    let mut found = bytes.to_vec();
    for (k, element) in found.chunks_exact_mut(width).enumerate() {
        for (rank, byte) in element.iter_mut().enumerate() {
            *byte = bytes[rank * count + k];
        }
    }
    found
}

fn checked(mut bytes: Vec<u8>) -> Result<Vec<u8>, &'static str> {
    let at = bytes.len().checked_sub(4).ok_or("a chunk is shorter than its check sum")?;
    let expected = u32::from_le_bytes(bytes.split_off(at).try_into().unwrap_or_default());
    // Releases before 1.6.3 swapped the bytes of each half on little-endian machines.
    let sum = fletcher_32(&bytes);
    let swapped = sum.swap_bytes().rotate_left(16);
    if expected == sum || expected == swapped { Ok(bytes) } else { Err("a chunk does not match its check sum") }
}
