//! Types of the elements of data sets, and how their bytes become numbers.

use super::numbers;

/// What an element is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Element {
    /// A floating-point number of IEEE 754, of 4 or 8 bytes.
    Float {
        /// Whether its highest byte comes first.
        is_big_endian: bool,
    },
    /// A whole number of 1 to 8 bytes.
    Integer {
        /// Whether its highest byte comes first.
        is_big_endian: bool,
        /// Whether it can be negative.
        is_signed: bool,
    },
    /// Something else: texts, compounds, references, numbers in unusual formats.
    Other,
}

impl Element {
    /// From a data type message: class and version, 24 bits of the class, size, properties.
    pub(super) fn from_message(data: &[u8]) -> Option<(Self, u64)> {
        let mut cursor = numbers(data);
        let class = cursor.number(1)? & 15;
        let bits = cursor.number(3)?;
        let size = cursor.number(4)?;
        let is_big_endian = bits & 1 != 0;
        let element = match class {
            0 if (1..=8).contains(&size) => {
                let (offset, precision) = (cursor.number(2)?, cursor.number(2)?);
                let is_plain = offset == 0 && precision == 8 * size;
                let integer = Self::Integer { is_big_endian, is_signed: bits & 8 != 0 };
                if is_plain { integer } else { Self::Other }
            }
            1 => {
                let properties: Option<Vec<u64>> = [2, 2, 1, 1, 1, 1, 4].iter().map(|n| cursor.number(*n)).collect();
                let sign = bits >> 8 & 0xFF;
                // An implied leading bit, and no byte order of the VAX.
                let is_usual = bits & 0x40 == 0 && bits >> 4 & 3 == 2;
                match (size, sign, properties?.as_slice()) {
                    (4, 31, [0, 32, 23, 8, 0, 23, 127]) | (8, 63, [0, 64, 52, 11, 0, 52, 1023]) if is_usual => {
                        Self::Float { is_big_endian }
                    }
                    _ => Self::Other,
                }
            }
            _ => Self::Other,
        };
        Some((element, size))
    }

    /// The value of an element; None where it is none that is read.
    pub(super) fn real(self, bytes: &[u8]) -> Option<f64> {
        match self {
            Self::Float { is_big_endian } => {
                let bits = whole(bytes, is_big_endian)?;
                Some(if bytes.len() == 4 { f64::from(f32::from_bits(bits as u32)) } else { f64::from_bits(bits) })
            }
            Self::Integer { is_signed: false, is_big_endian } => whole(bytes, is_big_endian).map(|value| value as f64),
            Self::Integer { .. } => self.integer(bytes).map(|value| value as f64),
            Self::Other => None,
        }
    }

    /// The value of a whole number; None where it is none, or larger than 2⁶³ − 1.
    pub(super) fn integer(self, bytes: &[u8]) -> Option<i64> {
        let Self::Integer { is_big_endian, is_signed } = self else { return None };
        let value = whole(bytes, is_big_endian)?;
        if !is_signed {
            return i64::try_from(value).ok();
        }
        let unused = 64 - 8 * u32::try_from(bytes.len()).ok()?;
        Some((value << unused).cast_signed() >> unused)
    }
}

fn whole(bytes: &[u8], is_big_endian: bool) -> Option<u64> {
    if bytes.is_empty() || bytes.len() > 8 {
        return None;
    }
    let push = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
    Some(if is_big_endian { bytes.iter().fold(0, push) } else { bytes.iter().rev().fold(0, push) })
}
