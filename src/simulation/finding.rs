//! What a run notices about itself: findings, and checks of invariants with their limits.

use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// An event of the physics: a droplet split, a front vanished.
    Info,
    /// The results may be wrong because of it.
    Warning,
}

/// Something that a run noticed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Short name, such as `front_open`.
    pub code: Cow<'static, str>,
    /// How much it matters.
    pub severity: Severity,
    /// A sentence with numbers.
    pub message: String,
    /// How many points, or events, it is about.
    pub count: u64,
    /// The first few of the points, by their index in the frame of that step; empty where it is about none.
    pub points: Vec<u64>,
    /// Scene time at which it was noticed.
    pub time: f64,
    /// Step in which it was noticed.
    pub step: u64,
    /// What may be done about it.
    pub advice: Option<Cow<'static, str>>,
}

/// Points that a finding names at most; `count` tells of all.
pub const MOST_POINTS: usize = 8;

impl Finding {
    /// An event of the physics that is about no points.
    #[must_use]
    pub fn info(code: &'static str, message: String, (step, time): (u64, f64)) -> Self {
        let (severity, points) = (Severity::Info, Vec::new());
        Self { code: Cow::Borrowed(code), severity, message, count: 1, points, time, step, advice: None }
    }

    /// A doubt about the results.
    #[must_use]
    pub fn warning(code: &'static str, message: String, (step, time): (u64, f64)) -> Self {
        Self { severity: Severity::Warning, ..Self::info(code, message, (step, time)) }
    }

    /// The same finding about points: it names the first few and counts all.
    #[must_use]
    pub fn about(mut self, points: &[usize]) -> Self {
        self.count = points.len() as u64;
        self.points = points.iter().take(MOST_POINTS).map(|point| *point as u64).collect();
        self
    }

    /// The same finding about so many points or events, none of which is named.
    #[must_use]
    pub fn with_count(mut self, count: u64) -> Self {
        self.count = count;
        self
    }

    /// The same finding with what may be done about it.
    #[must_use]
    pub fn with_advice(mut self, advice: &'static str) -> Self {
        self.advice = Some(Cow::Borrowed(advice));
        self
    }
}

impl fmt::Display for Finding {
    /// One line for logs and terminals.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = if self.severity == Severity::Warning { "warning" } else { "note" };
        write!(f, "{severity} ({}) at step {}, time {}: {}", self.code, self.step, self.time, self.message)?;
        self.advice.as_ref().map_or(Ok(()), |advice| write!(f, "; {advice}"))
    }
}

/// An invariant that a scheme watches.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// Name, such as `enclosed_area`.
    pub name: Cow<'static, str>,
    /// Its present value; none before it was measured.
    pub value: Option<f64>,
    /// The bound that it must keep; none where the value is only watched.
    pub limit: Option<f64>,
    /// Unit of value and limit; empty where there is none.
    pub unit: Cow<'static, str>,
    /// Whether it holds; none before it was measured, or without a limit.
    pub holds: Option<bool>,
}

impl Check {
    /// A value that must not exceed a limit.
    #[must_use]
    pub fn at_most(name: &'static str, value: Option<f64>, limit: f64, unit: &'static str) -> Self {
        let value = value.filter(|value| value.is_finite());
        let holds = value.map(|value| value <= limit);
        Self { name: Cow::Borrowed(name), value, limit: Some(limit), unit: Cow::Borrowed(unit), holds }
    }

    /// A value that is watched without a limit.
    #[must_use]
    pub fn watched(name: &'static str, value: Option<f64>, unit: &'static str) -> Self {
        let value = value.filter(|value| value.is_finite());
        Self { name: Cow::Borrowed(name), value, limit: None, unit: Cow::Borrowed(unit), holds: None }
    }
}

/// The invariants of a run at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Health {
    /// Whether all numbers are finite.
    pub finite: bool,
    /// Largest displacement of a particle in a step, in spacings.
    pub max_cfl: f64,
    /// Relative change of the enclosed area or volume, where it is known.
    pub volume_drift: Option<f64>,
    /// What the scheme watches.
    pub checks: Vec<Check>,
}

/// What a run diverged in when a check no longer holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Divergence {
    /// The run gained energy from nothing.
    Energy,
    /// The run gained momentum from nothing.
    Momentum,
    /// Particles crowded: pairs came too close.
    Crowded,
    /// Area or volume of a phase was lost.
    PhaseLost,
    /// Something is finer than the particles resolve.
    Unresolved,
    /// Equations were not solved as the scene asks.
    Unsolved,
    /// Particles left the region that the method knows.
    Escaped,
}

#[cfg(test)]
mod tests {
    use super::{Check, Finding, Severity};

    #[test]
    fn a_check_holds_up_to_its_limit_and_not_before_it_is_measured() {
        assert_eq!(Check::at_most("area", Some(0.1), 0.1, "").holds, Some(true));
        assert_eq!(Check::at_most("area", Some(0.2), 0.1, "").holds, Some(false));
        assert_eq!(Check::at_most("area", Some(f64::NAN), 0.1, "").holds, None);
        assert_eq!(Check::watched("area", Some(0.2), "").holds, None);
    }

    #[test]
    fn a_finding_names_the_first_points_counts_all_and_survives_json() {
        let points: Vec<usize> = (0..20).collect();
        let finding = Finding::warning("front_open", "20 ends".into(), (3, 0.5)).about(&points).with_advice("refine");
        assert_eq!((finding.count, finding.points.len(), finding.severity), (20, 8, Severity::Warning));
        assert_eq!(finding.to_string(), "warning (front_open) at step 3, time 0.5: 20 ends; refine");
        let text = serde_json::to_string(&finding).unwrap();
        assert_eq!(serde_json::from_str::<Finding>(&text).unwrap(), finding);
    }
}
