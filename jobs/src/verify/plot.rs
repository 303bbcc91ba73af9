//! A plot of the full results: what is drawn of which runs. Each is a JSON file of `tests/validation/cases/KIND/plots`.

use super::case::{CaseError, parse};
use super::measure::Quantity;
use serde::Deserialize;
use serde_json::Value;

/// A plot; its file's name is that of the picture.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plot {
    /// Heading.
    pub title: String,
    /// What it shows.
    pub plot: Content,
}

/// What a plot shows. Runs are scenes.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Content {
    /// Error over spacing and over CPU time with logarithmic axes, one line for each method.
    SpeedAgainstError {
        /// The error shown.
        error: Quantity,
        /// The error shown of runs that do not report the first.
        fallback: Option<Quantity>,
        /// Beginning of the names of the cost spans whose CPU time is shown.
        spans: String,
        /// The runs of each method.
        lines: Vec<RunsLine>,
    },
    /// A column of the series over time, one line for each run.
    History {
        /// Name of the column.
        column: String,
        /// Whether the vertical axis is logarithmic.
        is_logarithmic: bool,
        /// The runs.
        lines: Vec<RunLine>,
        /// Reference points, (time, value).
        #[serde(default)]
        marks: Vec<(f64, f64)>,
    },
    /// A field of the last frame over the signed distance, one dot for each particle, one color for each run.
    Profile {
        /// Name of the field.
        field: String,
        /// Largest absolute distance shown.
        largest_distance: f64,
        /// The runs.
        lines: Vec<RunLine>,
    },
    /// An error over a number that stands for the run.
    Points {
        /// What the number is.
        across: String,
        /// The error shown.
        error: Quantity,
        /// The points of each line.
        lines: Vec<PointsLine>,
        /// Reference line, (number, value).
        expected: Vec<(f64, f64)>,
    },
    /// Frames of one run side by side.
    Frames {
        /// The run.
        run: Value,
        /// Scene time from one frame to the next.
        every_time: f64,
        /// Numbers of the frames shown.
        frames: Vec<usize>,
    },
}

/// A line over several runs.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunsLine {
    /// Text in the legend.
    pub label: String,
    /// The runs, a point each.
    pub runs: Vec<Value>,
}

/// A line of one run.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunLine {
    /// Text in the legend.
    pub label: String,
    /// The run.
    pub run: Value,
}

/// A line of runs with a number each.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointsLine {
    /// Text in the legend.
    pub label: String,
    /// The points.
    pub points: Vec<RunPoint>,
}

/// A run at its place on the horizontal axis.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunPoint {
    /// The number on the horizontal axis.
    pub at: f64,
    /// The run.
    pub run: Value,
}

impl Plot {
    /// A plot from the text of its file.
    ///
    /// # Errors
    /// [`CaseError`] with the first place that is wrong.
    pub fn parse(file: &str, text: &[u8]) -> Result<Self, CaseError> {
        parse(file, text)
    }

    /// All runs that it shows.
    #[must_use]
    pub fn runs(&self) -> Vec<&Value> {
        match &self.plot {
            Content::SpeedAgainstError { lines, .. } => lines.iter().flat_map(|line| &line.runs).collect(),
            Content::History { lines, .. } | Content::Profile { lines, .. } => {
                lines.iter().map(|line| &line.run).collect()
            }
            Content::Points { lines, .. } => {
                lines.iter().flat_map(|line| &line.points).map(|point| &point.run).collect()
            }
            Content::Frames { run, .. } => vec![run],
        }
    }
}
