//! A verification case of studies: trials of accuracies, orders, and series whose convergence is known. Each is a JSON file of
//! `tests/validation/cases/studies`.

use super::case::{CaseError, parse};
use serde::Deserialize;
use serde_json::{Map, Value};

/// Trials, orders and series with what must come out of them.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyCase {
    /// What is shown.
    pub title: String,
    /// Where the targets come from.
    pub source: String,
    /// What is tried.
    pub parts: Vec<Part>,
}

/// One thing that is tried.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Part {
    /// Accuracies that are asked for, beside the best set-up found by hand.
    Trials(Trials),
    /// The observed order of a study beside that of theory.
    Order {
        /// What is refined.
        title: String,
        /// The body that the levels share.
        base: Value,
        /// The sweep of the study.
        sweep: Value,
        /// The order that theory gives.
        order: f64,
    },
    /// A series whose convergence is known.
    Series {
        /// What the series does.
        title: String,
        /// Its spacings, the coarsest first.
        spacings: Vec<f64>,
        /// Its values.
        values: Vec<f64>,
        /// `monotone`, `oscillatory` or `divergent`.
        convergence: String,
    },
}

/// Accuracies that are asked for.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trials {
    /// What is asked for.
    pub title: String,
    /// The quantity, as in a job's accuracy.
    pub quantity: Value,
    /// Whether the tolerances are shares.
    #[serde(default)]
    pub relative: bool,
    /// Scenes without a spacing, with their tolerances.
    pub trials: Vec<Trial>,
    /// Set-ups that a person would try, by JSON pointer; the best of them is the measure of the cost.
    pub by_hand: Vec<Map<String, Value>>,
    /// Whether the runs take longer than a minute or two.
    #[serde(default)]
    pub is_long: bool,
}

/// A scene and a tolerance.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trial {
    /// The scene without a spacing.
    pub scene: Value,
    /// The tolerance.
    pub tolerance: f64,
}

impl StudyCase {
    /// A case from the text of its file.
    ///
    /// # Errors
    /// [`CaseError`] with the first place that is wrong.
    pub fn parse(file: &str, text: &[u8]) -> Result<Self, CaseError> {
        parse(file, text)
    }
}
