//! What a kind of scene must show, as data: runs, the figure that comes out of them, the paper's figure and the one to
//! reach. `meniscus verify` runs them; this module only says what.

use serde_json::Value;

/// A scene with the members of another object laid over it.
#[must_use]
pub fn with(mut scene: Value, more: &Value) -> Value {
    if let (Some(scene), Some(more)) = (scene.as_object_mut(), more.as_object()) {
        scene.extend(more.clone());
    }
    scene
}

/// One row of the table.
#[derive(Debug, Clone)]
pub struct Row {
    /// What is shown.
    pub case: String,
    /// The paper's figure, or that of another programme on the same work.
    pub paper: &'static str,
    /// The scenes, in the order that [`Measure`] reads them.
    pub runs: Vec<Value>,
    /// How the figure comes out of their reports.
    pub measure: Measure,
    /// What it must be.
    pub reach: Reach,
    /// Whether it takes longer than a minute or two, and runs only when everything is asked for.
    pub is_long: bool,
}

/// An error that reports hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// `phi`, `closest_point`, …
    pub name: &'static str,
    /// `rms`, `max`, `relative`, ….
    pub norm: &'static str,
    /// Scene time; None is the last one reported.
    pub time: Option<f64>,
}

impl Quantity {
    /// At the end of the run.
    #[must_use]
    pub const fn at_end(name: &'static str, norm: &'static str) -> Self {
        Self { name, norm, time: None }
    }

    /// At a scene time.
    #[must_use]
    pub const fn at(name: &'static str, norm: &'static str, time: f64) -> Self {
        Self { name, norm, time: Some(time) }
    }
}

/// How a figure comes out of the reports of runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Measure {
    /// The error of the last run.
    Error(Quantity),
    /// The largest error of all runs, each in multiples of its spacing.
    WorstInSpacings(Quantity),
    /// The slope of the least-squares line through log error over log spacing; errors below `floor` are round-off and
    /// left out.
    Order {
        /// Which error.
        of: Quantity,
        /// Where round-off begins.
        floor: f64,
    },
    /// The error of the last run by that of the first.
    Growth(Quantity),
    /// The distance of the last run's quantity from the first's.
    Difference(Quantity),
    /// Largest resident memory of the last run, bytes.
    Memory,
    /// CPU seconds that the last run spent in phases whose names begin so, per step.
    SecondsPerStep(&'static str),
    /// CPU seconds that the last run spent in such phases.
    Seconds(&'static str),
    /// CPU seconds of the last run in such phases by those of the first.
    SecondsShare(&'static str),
    /// How often the last run's report counts a rescue of this name.
    Rescued(&'static str),
}

/// What a figure must be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reach {
    /// Not above.
    AtMost(f64),
    /// Not below.
    AtLeast(f64),
    /// Within a distance of a value.
    Within {
        /// The value.
        of: f64,
        /// The distance.
        by: f64,
    },
    /// Nothing: it is shown beside the others.
    Shown,
}

impl Reach {
    /// Whether a figure fulfils it; NaN fulfils nothing.
    #[must_use]
    pub fn is_met(self, figure: f64) -> bool {
        match self {
            Self::AtMost(most) => figure <= most,
            Self::AtLeast(least) => figure >= least,
            Self::Within { of, by } => (figure - of).abs() <= by,
            Self::Shown => figure.is_finite(),
        }
    }
}

/// A picture of the full table.
#[derive(Debug, Clone)]
pub struct Figure {
    /// Name of its file.
    pub name: &'static str,
    /// Heading.
    pub title: &'static str,
    /// What it shows.
    pub plot: Plot,
}

/// What a picture shows. Runs are scenes.
#[derive(Debug, Clone)]
pub enum Plot {
    /// Error over spacing and over CPU time, log-log, one line a method.
    SpeedAgainstError {
        /// The error shown.
        quantity: Quantity,
        /// What is shown of runs that do not report it.
        otherwise: Option<Quantity>,
        /// Prefix of the phases whose CPU time is shown.
        phases: &'static str,
        /// A label and the runs of each line.
        lines: Vec<(String, Vec<Value>)>,
    },
    /// A column of the series over time, one line a run.
    History {
        /// The column.
        column: &'static str,
        /// Whether the ordinate is logarithmic.
        is_log: bool,
        /// A label and the run of each line.
        lines: Vec<(String, Value)>,
        /// Reference points, (time, value).
        marks: Vec<(f64, f64)>,
    },
    /// A field of the last frame over φ, a dot a particle, one colour a run.
    Profile {
        /// The field.
        field: &'static str,
        /// Largest |φ| shown.
        reach: f64,
        /// A label and the run of each colour.
        lines: Vec<(String, Value)>,
    },
    /// A quantity of the report over a number that stands for the run.
    Points {
        /// What the number is.
        across: &'static str,
        /// The quantity.
        quantity: Quantity,
        /// A label, and the number and the run of each point.
        lines: Vec<(String, Vec<(f64, Value)>)>,
        /// Reference line, (number, value).
        expected: Vec<(f64, f64)>,
    },
    /// Frames of one run side by side.
    Frames {
        /// The run.
        scene: Value,
        /// Scene time from one frame to the next.
        every_time: f64,
        /// Which of them.
        chosen: Vec<usize>,
    },
}

/// What a kind must show.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    /// Name of the document that the full table goes to; kinds may share one.
    pub document: &'static str,
    /// Rows of the table.
    pub rows: Vec<Row>,
    /// Pictures of the full table.
    pub figures: Vec<Figure>,
}

#[cfg(test)]
mod tests {
    use super::Reach;

    #[test]
    fn nothing_is_met_by_what_is_no_number() {
        for reach in [Reach::AtMost(1.0), Reach::AtLeast(0.0), Reach::Within { of: 1.0, by: 5.0 }, Reach::Shown] {
            assert!(!reach.is_met(f64::NAN));
            assert!(reach.is_met(1.0));
        }
    }
}
