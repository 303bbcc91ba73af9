//! The Fletcher-32 sum that HDF5 puts behind a chunk.

/// Words of 16 bits that are added before the sums are folded.
const WORDS: usize = 360;

/// The sum of some bytes, as words of 16 bits with the high byte first.
pub(super) fn fletcher_32(bytes: &[u8]) -> u32 {
    let fold = |sum: u32| (sum & 0xFFFF) + (sum >> 16);
    let (words, rest) = bytes.as_chunks::<2>();
    let (mut first, mut second) = (0_u32, 0_u32);
    for words in words.chunks(WORDS) {
        for word in words {
            first = first.wrapping_add(u32::from(u16::from_be_bytes(*word)));
            second = second.wrapping_add(first);
        }
        (first, second) = (fold(first), fold(second));
    }
    if let [last] = rest {
        first = first.wrapping_add(u32::from(*last) << 8);
        second = second.wrapping_add(first);
        (first, second) = (fold(first), fold(second));
    }
    fold(second) << 16 | fold(first)
}
