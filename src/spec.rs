//! Declared parameters: each is written down once, with its meaning, range and default.
//!
//! [`group!`](crate::group), [`choice!`](crate::choice) and [`words!`](crate::words) turn a declaration into a type. From it
//! come parsing with all errors at once and suggestions, defaults, presets, the resolved body and the JSON Schema.

pub mod choice;
pub mod group;
pub mod lists;
mod macros;
pub mod parameter;
pub mod places;
pub mod preset;
pub mod violation;

pub use choice::{AtLeast, Choice, Variant, Word};
pub use group::{Declaration, Field, Group};
pub use lists::{Items, Listed};
pub use parameter::{Coordinates, Interval, NOT_NEGATIVE, POSITIVE, Parameter, Raw, Sign, Whole, whole};
pub use places::Places;
pub use preset::{Given, Key, Preset};
pub use violation::{Violation, escape, suggest};

/// Any JSON.
pub use serde_json::Value as Json;

/// A JSON object.
pub type Object = serde_json::Map<String, Json>;
