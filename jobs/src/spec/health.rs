//! The health of a job: what its run watches and what it noticed.

pub use meniscus::simulation::{Finding, Severity};

use meniscus::simulation::{Check, Health};
use serde::{Deserialize, Serialize};

/// Whether the results can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HealthStatus {
    /// Every check holds, and nothing was noticed that speaks against the results.
    Sound,
    /// A check does not hold, or a finding is a warning.
    Doubtful,
}

impl HealthStatus {
    /// The word that stands for it in JSON and in the store.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Sound => "sound",
            Self::Doubtful => "doubtful",
        }
    }

    /// From its word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::Sound, Self::Doubtful].into_iter().find(|status| status.word() == word)
    }
}

/// The health of a run, as records, jobs and reports show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct HealthRecord {
    /// None before the first look.
    pub status: Option<HealthStatus>,
    /// Whether all numbers are finite.
    pub finite: bool,
    /// Longest way of a particle in a step, in spacings.
    pub max_cfl: f64,
    /// Relative change of the enclosed area or volume, where it is known.
    pub volume_drift: Option<f64>,
    /// What the scheme watches.
    pub checks: Vec<Check>,
    /// What was noticed, in order. Records of progress leave it empty: findings have records of their own.
    pub findings: Vec<Finding>,
}

impl Default for HealthRecord {
    fn default() -> Self {
        Self { status: None, finite: true, max_cfl: 0.0, volume_drift: None, checks: Vec::new(), findings: Vec::new() }
    }
}

/// Findings that a job keeps; later ones are events alone.
pub const MOST_FINDINGS: usize = 200;

/// What a run noticed so far.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FindingLog {
    findings: Vec<Finding>,
    is_doubtful: bool,
}

impl FindingLog {
    /// The log with what earlier attempts noticed.
    #[must_use]
    pub fn new(findings: Vec<Finding>) -> Self {
        let is_doubtful = findings.iter().any(|finding| finding.severity == Severity::Warning);
        Self { findings, is_doubtful }
    }

    /// Takes a finding; beyond [`MOST_FINDINGS`] a warning takes the place of the last event.
    pub fn push(&mut self, finding: Finding) {
        let is_warning = finding.severity == Severity::Warning;
        self.is_doubtful |= is_warning;
        if self.findings.len() < MOST_FINDINGS {
            self.findings.push(finding);
        } else if is_warning
            && let Some(place) = self.findings.iter().rposition(|known| known.severity == Severity::Info)
        {
            self.findings.remove(place);
            self.findings.push(finding);
        }
    }

    /// Forgets what was noticed after a step: it is going to be noticed again.
    pub fn truncate(&mut self, step: u64) {
        self.findings.retain(|finding| finding.step <= step);
        self.is_doubtful = self.findings.iter().any(|finding| finding.severity == Severity::Warning);
    }

    /// The findings that are kept, in order.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// The health of a run with these findings, which it does not list.
    #[must_use]
    pub fn health(&self, health: Health) -> HealthRecord {
        let Health { finite, max_cfl, volume_drift, checks } = health;
        let fails = !finite || checks.iter().any(|check| check.holds == Some(false));
        let status = if self.is_doubtful || fails { HealthStatus::Doubtful } else { HealthStatus::Sound };
        // JSON has no number for what is not finite.
        let volume_drift = volume_drift.filter(|drift| drift.is_finite());
        HealthRecord { status: Some(status), finite, max_cfl, volume_drift, checks, findings: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::{FindingLog, HealthStatus, MOST_FINDINGS};
    use meniscus::simulation::{Check, Finding, Health};

    fn health(checks: Vec<Check>) -> Health {
        Health { finite: true, max_cfl: 0.5, volume_drift: Some(f64::NAN), checks }
    }

    #[test]
    fn warnings_and_broken_checks_make_a_run_doubtful_and_events_do_not() {
        let mut log = FindingLog::default();
        let status = |log: &FindingLog, checks| log.health(health(checks)).status;
        log.push(Finding::info("split", "2 droplets".into(), (1, 0.1)));
        assert_eq!(status(&log, Vec::new()), Some(HealthStatus::Sound));
        assert_eq!(log.health(health(Vec::new())).volume_drift, None);
        assert_eq!(status(&log, vec![Check::at_most("area", Some(2.0), 1.0, "")]), Some(HealthStatus::Doubtful));
        log.push(Finding::warning("front_open", "ends".into(), (2, 0.2)));
        assert_eq!(status(&log, Vec::new()), Some(HealthStatus::Doubtful));
        log.truncate(1);
        assert_eq!((status(&log, Vec::new()), log.findings().len()), (Some(HealthStatus::Sound), 1));
    }

    #[test]
    fn the_log_is_bounded_and_never_loses_a_warning_to_an_event() {
        let mut log = FindingLog::default();
        for step in 0..500 {
            log.push(Finding::info("split", String::new(), (step, 0.0)));
        }
        log.push(Finding::warning("front_open", String::new(), (500, 0.0)));
        assert_eq!(log.findings().len(), MOST_FINDINGS);
        assert_eq!(log.findings().last().unwrap().code, "front_open");
    }
}
