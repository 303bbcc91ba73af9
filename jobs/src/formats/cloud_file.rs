//! Points in a plain format of our own: what a checked upload becomes. Numbers are little-endian doubles.
//!
//! `MNSCLOUD` · count (u64) · columns (u32: 3 for the positions, + 1 with a level, + 3 with normals) · points that were left
//! out (u32) · positions, levels, normals, one after another · corners of triangles (u32), if there are some.

use meniscus::scene::Cloud;
use std::io::{self, Read, Write};

const MAGIC: &[u8; 8] = b"MNSCLOUD";

/// Bytes before the columns.
const HEAD: usize = 24;
/// Columns at most.
const MOST_COLUMNS: u64 = 7;
/// Bytes of a triangle.
const TRIANGLE: usize = 12;
/// Triangles at most: a closed surface has about twice as many as points.
pub const MOST_TRIANGLES: u64 = 4 * crate::spec::uploads::MOST_POINTS;
/// Bytes of a file at most.
pub const MOST_BYTES: u64 =
    HEAD as u64 + crate::spec::uploads::MOST_POINTS * MOST_COLUMNS * 8 + MOST_TRIANGLES * TRIANGLE as u64;

/// Writes points.
///
/// # Errors
/// When they cannot be written.
pub fn write(out: &mut impl Write, cloud: &Cloud) -> io::Result<()> {
    let Cloud { positions, level, normals, triangles, left_out } = cloud;
    let columns = 3 + u64::from(level.is_some()) + 3 * u64::from(normals.is_some());
    out.write_all(MAGIC)?;
    out.write_all(&(positions.len() as u64).to_le_bytes())?;
    out.write_all(&(columns | left_out << 32).to_le_bytes())?;
    let normals = normals.iter().flat_map(|normals| normals.as_flattened());
    for number in positions.as_flattened().iter().chain(level.iter().flatten()).chain(normals) {
        out.write_all(&number.to_le_bytes())?;
    }
    triangles.as_flattened().iter().try_for_each(|corner| out.write_all(&corner.to_le_bytes()))
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
    let (count, columns, left_out) = (number(8), number(16) & u64::from(u32::MAX), number(16) >> 32);
    if head[..8] != *MAGIC || ![3, 4, 6, MOST_COLUMNS].contains(&columns) || count > crate::spec::uploads::MOST_POINTS {
        return Err(wrong());
    }
    let mut bytes = Vec::new();
    input.read_to_end(&mut bytes)?;
    let (numbers, corners) = bytes.split_at_checked((count * columns * 8) as usize).ok_or_else(wrong)?;
    if corners.len() % TRIANGLE != 0 {
        return Err(wrong());
    }
    let corners: Vec<u32> = corners.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
    if corners.iter().any(|corner| u64::from(*corner) >= count) {
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
        triangles: corners.as_chunks::<3>().0.to_vec(),
        left_out,
    })
}

#[cfg(test)]
mod tests {
    use super::{Cloud, read, write};

    #[test]
    fn triangles_name_points_that_are_there() {
        let cloud = Cloud { positions: vec![[0.0; 3]; 3], triangles: vec![[0, 1, 3]], ..Cloud::default() };
        let mut bytes = Vec::new();
        write(&mut bytes, &cloud).unwrap();
        assert!(read(&mut bytes.as_slice()).is_err());
    }

    #[test]
    fn points_come_back_and_half_a_file_is_refused() {
        let positions = vec![[0.5, -1.0, 0.0], [f64::MIN_POSITIVE, 2.0, 3.0]];
        for level in [None, Some(vec![0.25, -7.0])] {
            for normals in [None, Some(vec![[0.0, 0.0, 1.0], [0.5, 0.0, -2.0]])] {
                for triangles in [Vec::new(), vec![[0, 1, 1], [1, 0, 1]]] {
                    let (positions, level, normals) = (positions.clone(), level.clone(), normals.clone());
                    let left_out = triangles.len() as u64;
                    let cloud = Cloud { positions, level, normals, triangles, left_out };
                    let mut bytes = Vec::new();
                    write(&mut bytes, &cloud).unwrap();
                    assert_eq!(read(&mut bytes.as_slice()).unwrap(), cloud);
                    assert!(read(&mut &bytes[..bytes.len() - 1]).is_err());
                }
            }
        }
    }
}
