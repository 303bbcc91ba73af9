//! Numbers that JSON could not hold: NaN and infinity are written as null, which is read back as zero.

use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;

/// A number, zero where null stands for it.
///
/// # Errors
/// When it is neither a number nor null.
pub(crate) fn null_is_zero<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(0.0))
}

/// Numbers by name, zero where null stands for one.
///
/// # Errors
/// When one of them is neither a number nor null.
pub(crate) fn nulls_are_zero<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, f64>, D::Error> {
    let numbers: BTreeMap<String, Option<f64>> = BTreeMap::deserialize(deserializer)?;
    Ok(numbers.into_iter().map(|(name, number)| (name, number.unwrap_or(0.0))).collect())
}
