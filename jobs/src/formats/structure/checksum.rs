//! The sums that HDF5 puts behind chunks (Fletcher-32) and behind metadata (Jenkins' lookup3).

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

/// The sum of metadata: lookup3 by Bob Jenkins, as `hashlittle` with the start 0.
pub(super) fn lookup_3(bytes: &[u8]) -> u32 {
    let start = 0xDEAD_BEEF_u32.wrapping_add(bytes.len() as u32);
    let [mut a, mut b, mut c] = [start; 3];
    let blocks = bytes.len().div_ceil(12);
    for (k, block) in bytes.chunks(12).enumerate() {
        let word =
            |from: usize| (0..4).fold(0, |word, d| word | u32::from(*block.get(from + d).unwrap_or(&0)) << (8 * d));
        (a, b, c) = (a.wrapping_add(word(0)), b.wrapping_add(word(4)), c.wrapping_add(word(8)));
        if k + 1 < blocks {
            for turn in [4, 6, 8, 16, 19, 4] {
                a = a.wrapping_sub(c) ^ c.rotate_left(turn);
                c = c.wrapping_add(b);
                (a, b, c) = (b, c, a);
            }
        }
    }
    if blocks == 0 {
        return c;
    }
    for turn in [14, 11, 25, 16, 4, 14, 24] {
        c = (c ^ b).wrapping_sub(b.rotate_left(turn));
        (a, b, c) = (b, c, a);
    }
    // Seven turns leave the last word here.
    b
}

#[cfg(test)]
mod tests {
    use super::{fletcher_32, lookup_3};

    #[test]
    fn sums_are_those_that_their_authors_state() {
        // lookup3.c, driver5.
        assert_eq!(lookup_3(b""), 0xDEAD_BEEF);
        assert_eq!(lookup_3(b"Four score and seven years ago"), 0x1777_0551);
        // Words of 16 bits, the high byte first.
        assert_eq!(fletcher_32(&[0, 1, 0, 2]), 4 << 16 | 3);
        assert_eq!(fletcher_32(&[0, 1, 2]), 0x0202 << 16 | 0x0201);
    }
}
