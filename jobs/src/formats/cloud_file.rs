//! Points and values in a plain format of our own: what a checked upload becomes. Numbers are little-endian.
//!
//! `MNSDATA1` · bytes of the head (u64) · the head as JSON ([`Head`]) · positions, levels, normals, columns (doubles), one after
//! another · corners of triangles, places in the file (u32). Files of version 0.2.0 begin with `MNSCLOUD` and have no columns.

use meniscus::geometry::flows::GridNodes;
use meniscus::scene::{Cloud, Column};
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};

const MAGIC: &[u8; 8] = b"MNSDATA1";
const EARLIER: &[u8; 8] = b"MNSCLOUD";

/// Bytes of the head at most.
const LONGEST_HEAD: u64 = 1 << 22;
/// Columns of positions, levels and normals.
const OWN_COLUMNS: u64 = 7;
/// Triangles at most: a closed surface has about twice as many as points.
pub const MOST_TRIANGLES: u64 = 4 * crate::spec::uploads::MOST_POINTS;
/// Numbers of all further columns at most.
pub const MOST_VALUES: u64 = 100_000_000;
/// Bytes of a file at most.
pub const MOST_BYTES: u64 = 16
    + LONGEST_HEAD
    + crate::spec::uploads::MOST_POINTS * (OWN_COLUMNS * 8 + 4)
    + MOST_VALUES * 8
    + MOST_TRIANGLES * 12;

/// What is in a file.
#[derive(Debug, Serialize, Deserialize)]
struct Head {
    points: usize,
    has_level: bool,
    has_normals: bool,
    /// Names and lengths of the columns.
    columns: Vec<(String, usize)>,
    triangles: usize,
    left_out: u64,
    has_places: bool,
    /// Where the values of columns lie, if at the nodes of a grid.
    #[serde(default)]
    grid: Option<GridHead>,
}

#[derive(Debug, Serialize, Deserialize)]
struct GridHead {
    counts: [usize; 3],
    origin: [f64; 3],
    spacing: [f64; 3],
    times: Vec<f64>,
}

/// Writes points.
///
/// # Errors
/// When they cannot be written.
pub fn write(out: &mut impl Write, cloud: &Cloud) -> io::Result<()> {
    let Cloud { positions, level, normals, triangles, left_out, kept, columns, grid } = cloud;
    let head = serde_json::to_vec(&Head {
        points: positions.len(),
        has_level: level.is_some(),
        has_normals: normals.is_some(),
        columns: columns.iter().map(|column| (column.name.clone(), column.values.len())).collect(),
        triangles: triangles.len(),
        left_out: *left_out,
        has_places: !kept.is_empty(),
        grid: grid.as_ref().map(|nodes| GridHead {
            counts: nodes.counts,
            origin: nodes.origin,
            spacing: nodes.spacing,
            times: nodes.times.clone(),
        }),
    })?;
    out.write_all(MAGIC)?;
    out.write_all(&(head.len() as u64).to_le_bytes())?;
    out.write_all(&head)?;
    let normals = normals.iter().flat_map(|normals| normals.as_flattened());
    let columns = columns.iter().flat_map(|column| &column.values);
    for number in positions.as_flattened().iter().chain(level.iter().flatten()).chain(normals).chain(columns) {
        out.write_all(&number.to_le_bytes())?;
    }
    triangles.as_flattened().iter().chain(kept).try_for_each(|number| out.write_all(&number.to_le_bytes()))
}

fn wrong() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, "this is no file of points")
}

/// Reads points.
///
/// # Errors
/// When they cannot be read, or are no points of this format.
pub fn read(input: &mut impl Read) -> io::Result<Cloud> {
    let mut magic = [0; 8];
    input.read_exact(&mut magic)?;
    let head = match &magic {
        MAGIC => head(input)?,
        EARLIER => head_of_earlier_version(input)?,
        _ => return Err(wrong()),
    };
    let mut bytes = Vec::new();
    input.take(MOST_BYTES).read_to_end(&mut bytes)?;
    let mut rest = bytes.as_slice();
    let positions = triples(&mut rest, head.points)?;
    let level = if head.has_level { Some(reals(&mut rest, head.points)?) } else { None };
    let normals = if head.has_normals { Some(triples(&mut rest, head.points)?) } else { None };
    let column = |(name, length)| reals(&mut rest, length).map(|values| Column { name, values });
    let columns = head.columns.into_iter().map(column).collect::<io::Result<_>>()?;
    // The earlier version does not count its triangles.
    let triangles = if magic == *EARLIER { rest.len() / 12 } else { head.triangles };
    let corners = counts(&mut rest, triangles.checked_mul(3).ok_or_else(wrong)?)?;
    let kept = if head.has_places { counts(&mut rest, head.points)? } else { Vec::new() };
    if !rest.is_empty() || corners.iter().any(|corner| *corner as usize >= head.points) {
        return Err(wrong());
    }
    let triangles = corners.as_chunks::<3>().0.to_vec();
    let grid =
        head.grid.map(|GridHead { counts, origin, spacing, times }| GridNodes { counts, origin, spacing, times });
    Ok(Cloud { positions, level, normals, triangles, left_out: head.left_out, kept, columns, grid })
}

fn head(input: &mut impl Read) -> io::Result<Head> {
    let length = number(input)?;
    if length > LONGEST_HEAD {
        return Err(wrong());
    }
    let mut text = vec![0; length as usize];
    input.read_exact(&mut text)?;
    serde_json::from_slice(&text).map_err(|_| wrong())
}

/// Count · columns (u32: 3 for the positions, + 1 with a level, + 3 with normals) · points that were left out (u32).
fn head_of_earlier_version(input: &mut impl Read) -> io::Result<Head> {
    let (points, columns) = (number(input)?, number(input)?);
    let (columns, left_out) = (columns & u64::from(u32::MAX), columns >> 32);
    if ![3, 4, 6, OWN_COLUMNS].contains(&columns) || points > crate::spec::uploads::MOST_POINTS {
        return Err(wrong());
    }
    Ok(Head {
        points: points as usize,
        has_level: columns == 4 || columns == OWN_COLUMNS,
        has_normals: columns >= 6,
        columns: Vec::new(),
        triangles: 0,
        left_out,
        has_places: false,
        grid: None,
    })
}

fn number(input: &mut impl Read) -> io::Result<u64> {
    let mut bytes = [0; 8];
    input.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

/// The next bytes of so many numbers.
fn next<'a>(rest: &mut &'a [u8], count: usize, width: usize) -> io::Result<&'a [u8]> {
    let bytes = count.checked_mul(width).ok_or_else(wrong)?;
    let (found, behind) = rest.split_at_checked(bytes).ok_or_else(wrong)?;
    *rest = behind;
    Ok(found)
}

fn reals(rest: &mut &[u8], count: usize) -> io::Result<Vec<f64>> {
    Ok(next(rest, count, 8)?.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
}

fn triples(rest: &mut &[u8], count: usize) -> io::Result<Vec<[f64; 3]>> {
    Ok(reals(rest, count.checked_mul(3).ok_or_else(wrong)?)?.as_chunks::<3>().0.to_vec())
}

fn counts(rest: &mut &[u8], count: usize) -> io::Result<Vec<u32>> {
    Ok(next(rest, count, 4)?.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect())
}

#[cfg(test)]
mod tests {
    use super::{Cloud, Column, EARLIER, GridNodes, read, write};

    fn written(cloud: &Cloud) -> Vec<u8> {
        let mut bytes = Vec::new();
        write(&mut bytes, cloud).unwrap();
        bytes
    }

    #[test]
    fn triangles_name_points_that_are_there() {
        let cloud = Cloud { positions: vec![[0.0; 3]; 3], triangles: vec![[0, 1, 3]], ..Cloud::default() };
        assert!(read(&mut written(&cloud).as_slice()).is_err());
    }

    #[test]
    fn points_come_back_and_half_a_file_is_refused() {
        let positions = vec![[0.5, -1.0, 0.0], [f64::MIN_POSITIVE, 2.0, 3.0]];
        for level in [None, Some(vec![0.25, -7.0])] {
            for normals in [None, Some(vec![[0.0, 0.0, 1.0], [0.5, 0.0, -2.0]])] {
                for triangles in [Vec::new(), vec![[0, 1, 1], [1, 0, 1]]] {
                    for columns in [Vec::new(), vec![Column { name: "a\"b".to_owned(), values: vec![3.0; 5] }]] {
                        let kept = if triangles.is_empty() { Vec::new() } else { vec![0, 3] };
                        let (positions, level, normals) = (positions.clone(), level.clone(), normals.clone());
                        let (left_out, triangles) = (triangles.len() as u64, triangles.clone());
                        let grid = (!columns.is_empty()).then(|| GridNodes {
                            counts: [5, 1, 1],
                            origin: [0.1, 0.2, 0.3],
                            spacing: [1.0 / 3.0; 3],
                            times: vec![0.0],
                        });
                        let cloud = Cloud { positions, level, normals, triangles, left_out, kept, columns, grid };
                        let bytes = written(&cloud);
                        assert_eq!(read(&mut bytes.as_slice()).unwrap(), cloud);
                        assert!(read(&mut &bytes[..bytes.len() - 1]).is_err());
                    }
                }
            }
        }
    }

    /// Uploads of version 0.2.0 lie in the directories of services that go on.
    #[test]
    fn files_of_the_earlier_version_are_read() {
        let mut bytes = EARLIER.to_vec();
        for number in [2_u64, 4 | 5 << 32] {
            bytes.extend(number.to_le_bytes());
        }
        for number in [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, -1.0, 0.5_f64] {
            bytes.extend(number.to_le_bytes());
        }
        for corner in [0_u32, 1, 1] {
            bytes.extend(corner.to_le_bytes());
        }
        let cloud = read(&mut bytes.as_slice()).unwrap();
        assert_eq!((cloud.positions[1], cloud.level), ([3.0, 4.0, 5.0], Some(vec![-1.0, 0.5])));
        assert_eq!((cloud.triangles, cloud.left_out), (vec![[0, 1, 1]], 5));
    }
}
