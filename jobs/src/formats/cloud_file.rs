//! Points in a plain format of our own: what a checked upload becomes. Numbers are little-endian doubles.
//!
//! `MNSCLOUD` · count (u64) · columns (u64: 3 for the positions, + 1 with a level) · the columns, one
//! after another.

use meniscus::scene::Cloud;
use std::io::{self, Read, Write};

const MAGIC: &[u8; 8] = b"MNSCLOUD";

/// Writes points.
///
/// # Errors
/// When they cannot be written.
pub fn write(out: &mut impl Write, positions: &[[f64; 3]], level: Option<&[f64]>) -> io::Result<()> {
    out.write_all(MAGIC)?;
    out.write_all(&(positions.len() as u64).to_le_bytes())?;
    out.write_all(&(3 + u64::from(level.is_some())).to_le_bytes())?;
    for number in positions.as_flattened().iter().chain(level.into_iter().flatten()) {
        out.write_all(&number.to_le_bytes())?;
    }
    Ok(())
}

/// Reads points.
///
/// # Errors
/// When they cannot be read, or are no points of this format.
pub fn read(input: &mut impl Read) -> io::Result<Cloud> {
    let wrong = || io::Error::new(io::ErrorKind::InvalidData, "this is no file of points");
    let mut head = [0; 24];
    input.read_exact(&mut head)?;
    let number = |at: usize| u64::from_le_bytes(head[at..at + 8].try_into().unwrap_or_default());
    let (count, columns) = (number(8), number(16));
    if head[..8] != *MAGIC || !(3..=4).contains(&columns) || count > crate::uploads::MOST_POINTS {
        return Err(wrong());
    }
    let mut numbers = Vec::new();
    input.read_to_end(&mut numbers)?;
    if numbers.len() as u64 != count * columns * 8 {
        return Err(wrong());
    }
    let numbers: Vec<f64> = numbers.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let (positions, level) = numbers.split_at(count as usize * 3);
    let level = (columns == 4).then(|| level.to_vec());
    Ok(Cloud { positions: positions.as_chunks::<3>().0.to_vec(), level })
}

#[cfg(test)]
mod tests {
    use super::{read, write};

    #[test]
    fn points_come_back_and_half_a_file_is_refused() {
        let (positions, level) = ([[0.5, -1.0, 0.0], [f64::MIN_POSITIVE, 2.0, 3.0]], [0.25, f64::NAN]);
        for level in [None, Some(level.as_slice())] {
            let mut bytes = Vec::new();
            write(&mut bytes, &positions, level).unwrap();
            let cloud = read(&mut bytes.as_slice()).unwrap();
            assert_eq!(cloud.positions, positions);
            assert_eq!(cloud.level.map(|l| l[0]), level.map(|l| l[0]));
            assert!(read(&mut &bytes[..bytes.len() - 1]).is_err());
        }
    }
}
