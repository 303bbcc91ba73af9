//! What a simulation reports, whatever its method: errors, health, diagnostics, and what automatic choices came to.

use super::finding::Health;
use serde::{Deserialize, Deserializer, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// One error against a reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ErrorEntry {
    /// Compared quantity: `phi`, `closest_point`, `normal`, `curvature`, `area`, `interface`, …
    pub quantity: String,
    /// Norm of the error, one of those that the scene's kind declares.
    pub norm: String,
    /// The error in the norm.
    #[serde(deserialize_with = "null_is_nan")]
    pub value: f64,
    /// Scene time of the comparison.
    pub time: f64,
    /// Reference of the comparison.
    pub reference: String,
}

/// A number that a method counts or measures about its own work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Diagnostic {
    /// Path-like name, such as `fits.larger_radius`.
    pub name: Cow<'static, str>,
    /// The value of the diagnostic.
    #[serde(deserialize_with = "null_is_nan")]
    pub value: f64,
    /// Unit; empty where there is none.
    pub unit: Cow<'static, str>,
    /// What it is, in a sentence.
    pub doc: Cow<'static, str>,
}

impl Diagnostic {
    /// A number without a unit.
    #[must_use]
    pub const fn new(name: &'static str, value: f64, doc: &'static str) -> Self {
        Self { name: Cow::Borrowed(name), value, unit: Cow::Borrowed(""), doc: Cow::Borrowed(doc) }
    }

    /// A diagnostic that is a count.
    #[must_use]
    pub const fn count(name: &'static str, count: u64, doc: &'static str) -> Self {
        Self::new(name, count as f64, doc)
    }
}

/// What a simulation reports. The program that runs it adds costs and provenance.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// Errors against exact answers.
    pub errors: Vec<ErrorEntry>,
    /// Invariants at the end.
    pub health: Health,
    /// Fallbacks of fits, iterations of solvers, strays and whatever else the method counts.
    pub diagnostics: Vec<Diagnostic>,
    /// Outcomes of automatic choices, and their reasons.
    pub method: BTreeMap<&'static str, String>,
}

impl Report {
    /// The value of a diagnostic.
    #[must_use]
    pub fn diagnostic(&self, name: &str) -> Option<f64> {
        self.diagnostics.iter().find(|diagnostic| diagnostic.name == name).map(|diagnostic| diagnostic.value)
    }
}

/// JSON has no NaN and writes null.
fn null_is_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}
