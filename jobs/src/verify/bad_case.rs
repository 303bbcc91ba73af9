//! A run that must not pass for a success: a JSON file of `tests/validation/bad`. It is refused, ends with a reason, or says what
//! is doubtful.

use super::case::{CaseError, job_body, parse};
use crate::spec::health::HealthStatus;
use crate::spec::report::RunReport;
use meniscus::simulation::Severity;
use serde::Deserialize;
use serde_json::Value;
use std::fmt;

/// What becomes of a bad run, or should become of it.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Fate {
    /// It ends with this reason.
    Ended(String),
    /// It is refused at this place.
    Refused(String),
    /// It ends as doubtful, with this finding.
    Doubtful(String),
    /// It passes for a success.
    Sound,
}

impl Fate {
    /// What a finished run thinks of itself; a doubt is told by the finding that was expected, else by the first.
    pub(super) fn of_report(report: &RunReport, expected: Option<&Fate>) -> Self {
        let warnings = || report.health.findings.iter().filter(|finding| finding.severity == Severity::Warning);
        if report.health.status != Some(HealthStatus::Doubtful) {
            return Self::Sound;
        }
        let is_expected = |code: &str| matches!(expected, Some(Self::Doubtful(wanted)) if wanted == code);
        let finding = warnings().find(|finding| is_expected(&finding.code)).or_else(|| warnings().next());
        Self::Doubtful(finding.map_or_else(String::new, |finding| finding.code.to_string()))
    }
}

impl fmt::Display for Fate {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Ended(reason) => write!(formatter, "ends with `{reason}`"),
            Self::Refused(place) => write!(formatter, "is refused at `{place}`"),
            Self::Doubtful(finding) => write!(formatter, "is doubtful (`{finding}`)"),
            Self::Sound => formatter.write_str("passes for sound"),
        }
    }
}

/// A bad run.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BadCase {
    /// What is computed.
    pub title: String,
    /// Where it comes from.
    pub source: String,
    /// Its scene or job body.
    run: Value,
    /// What must become of it.
    pub expect: Fate,
}

impl BadCase {
    /// From the text of its file.
    ///
    /// # Errors
    /// [`CaseError`] with the first place that is wrong.
    pub fn parse(file: &str, text: &[u8]) -> Result<Self, CaseError> {
        parse(file, text)
    }

    /// Its job body.
    #[must_use]
    pub fn body(&self) -> Value {
        job_body(&self.run)
    }
}
