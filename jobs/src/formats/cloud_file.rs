//! Points in a plain format of our own: what a checked upload becomes. Numbers are little-endian doubles.
//!
//! `MNSCLOUD` · count (u64) · columns (u64: 3 for the positions, + 1 with a level, + 3 with normals) · positions, levels,
//! normals, one after another.

use meniscus::scene::Cloud;
use std::io::{self, Read, Write};

const MAGIC: &[u8; 8] = b"MNSCLOUD";

/// Bytes before the columns.
const HEAD: usize = 24;
/// Columns at most.
const MOST_COLUMNS: u64 = 7;
/// Bytes of a file at most.
pub const MOST_BYTES: u64 = HEAD as u64 + crate::spec::uploads::MOST_POINTS * MOST_COLUMNS * 8;

/// Writes points.
///
/// # Errors
/// When they cannot be written.
pub fn write(out: &mut impl Write, cloud: &Cloud) -> io::Result<()> {
    let Cloud { positions, level, normals } = cloud;
    let columns = 3 + u64::from(level.is_some()) + 3 * u64::from(normals.is_some());
    out.write_all(MAGIC)?;
    out.write_all(&(positions.len() as u64).to_le_bytes())?;
    out.write_all(&columns.to_le_bytes())?;
    let normals = normals.iter().flat_map(|normals| normals.as_flattened());
    for number in positions.as_flattened().iter().chain(level.iter().flatten()).chain(normals) {
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
    let mut head = [0; HEAD];
    input.read_exact(&mut head)?;
    let number = |at: usize| u64::from_le_bytes(head[at..at + 8].try_into().unwrap_or_default());
    let (count, columns) = (number(8), number(16));
    if head[..8] != *MAGIC || ![3, 4, 6, MOST_COLUMNS].contains(&columns) || count > crate::spec::uploads::MOST_POINTS {
        return Err(wrong());
    }
    let mut numbers = Vec::new();
    input.read_to_end(&mut numbers)?;
    if numbers.len() as u64 != count * columns * 8 {
        return Err(wrong());
    }
    let numbers: Vec<f64> = numbers.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    let (positions, rest) = numbers.split_at(count as usize * 3);
    let has_level = columns == 4 || columns == MOST_COLUMNS;
    let (level, normals) = rest.split_at(if has_level { count as usize } else { 0 });
    Ok(Cloud {
        positions: positions.as_chunks::<3>().0.to_vec(),
        level: has_level.then(|| level.to_vec()),
        normals: (columns >= 6).then(|| normals.as_chunks::<3>().0.to_vec()),
    })
}

#[cfg(test)]
mod tests {
    use super::{Cloud, read, write};

    #[test]
    fn points_come_back_and_half_a_file_is_refused() {
        let positions = vec![[0.5, -1.0, 0.0], [f64::MIN_POSITIVE, 2.0, 3.0]];
        for level in [None, Some(vec![0.25, -7.0])] {
            for normals in [None, Some(vec![[0.0, 0.0, 1.0], [0.5, 0.0, -2.0]])] {
                let cloud = Cloud { positions: positions.clone(), level: level.clone(), normals };
                let mut bytes = Vec::new();
                write(&mut bytes, &cloud).unwrap();
                assert_eq!(read(&mut bytes.as_slice()).unwrap(), cloud);
                assert!(read(&mut &bytes[..bytes.len() - 1]).is_err());
            }
        }
    }
}
