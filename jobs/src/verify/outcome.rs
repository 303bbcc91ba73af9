//! A target with its value, and how people read it.

use super::case::{Bound, Case, Target, job_body};
use super::measure::{self, FinishedRun};
use serde_json::Value;
use std::fmt::{Display, Formatter};

/// One target with its value.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Name of the case with its kind, such as `redistance/square`.
    pub case: String,
    /// What is measured.
    pub title: String,
    /// The value of the paper.
    pub paper: Option<String>,
    /// What is to be reached.
    pub bound: Bound,
    /// The value; NaN when there is none.
    pub value: f64,
    /// CPU seconds of all runs that the target reads.
    pub cpu_s: f64,
    /// Whether the value meets the bound.
    pub is_met: bool,
    /// Why there is no value.
    pub failure: Option<String>,
}

impl Outcome {
    /// The outcome of a target; `finish` hands out a finished run by its name and job body.
    pub fn of_target(
        name: &str,
        case: &Case,
        target: &Target,
        mut finish: impl FnMut(&str, &Value) -> Result<FinishedRun, String>,
    ) -> Self {
        let (mut runs, mut failure) = (Vec::new(), None);
        for (run, written) in case.runs_of(target) {
            match finish(run, &job_body(written)) {
                Ok(finished) => runs.push(finished),
                Err(cause) => failure = failure.or(Some(cause)),
            }
        }
        let value = if failure.is_none() { measure::evaluate(&target.measure, &runs) } else { f64::NAN };
        Self {
            case: name.to_owned(),
            title: target.title.clone(),
            paper: target.paper.clone(),
            bound: target.bound,
            value,
            cpu_s: runs.iter().map(|run| run.report.cost.cpu_s).sum(),
            is_met: target.bound.is_met(value),
            failure,
        }
    }

    /// Target, value of the paper, bound, value and verdict on one line.
    #[must_use]
    pub fn line(&self) -> String {
        let (title, paper, value) = (&self.title, self.paper(), number(self.value));
        format!("{title:<62} {paper:>20}  {:>18} {value:>10}  {}", self.bound, self.verdict())
    }

    /// "met", "missed", why there is no value, or nothing where there is no bound.
    pub(super) fn verdict(&self) -> &str {
        match (&self.failure, self.bound, self.is_met) {
            (Some(cause), _, _) => cause,
            (None, Bound::None, true) => "",
            (None, _, true) => "met",
            (None, _, false) => "missed",
        }
    }

    pub(super) fn paper(&self) -> &str {
        self.paper.as_deref().unwrap_or("–")
    }
}

/// A value as people write it.
pub(super) fn number(value: f64) -> String {
    if (0.01..1000.0).contains(&value.abs()) { format!("{value:.3}") } else { format!("{value:.2e}") }
}

impl Display for Bound {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let text = match self {
            Self::AtMost(most) => format!("≤ {}", number(*most)),
            Self::AtLeast(least) => format!("≥ {}", number(*least)),
            Self::Within { value, tolerance } => format!("{} ± {}", number(*value), number(*tolerance)),
            Self::None => "–".to_owned(),
        };
        f.pad(&text)
    }
}

impl Display for Outcome {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{:<40} {:<62} {:>20}  {:>18} {:>10} {:>8.1} s  {}",
            self.case,
            self.title,
            self.paper(),
            self.bound,
            number(self.value),
            self.cpu_s,
            self.verdict()
        )
    }
}
