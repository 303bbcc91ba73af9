//! What is wrong with a formula.

/// What is wrong with a formula, and where.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("column {column}: {detail}")]
pub struct FormulaError {
    /// Column of the character at fault, counted from 1.
    pub column: usize,
    /// What is wrong.
    pub detail: String,
    /// What may stand there; empty where it follows from the detail.
    pub allowed: String,
    /// A known name that is close to the one given.
    pub did_you_mean: Option<String>,
}

impl FormulaError {
    pub(super) fn new(column: usize, detail: impl Into<String>) -> Self {
        Self { column, detail: detail.into(), allowed: String::new(), did_you_mean: None }
    }

    pub(super) fn allowing(self, allowed: impl Into<String>) -> Self {
        Self { allowed: allowed.into(), ..self }
    }
}
