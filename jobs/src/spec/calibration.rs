//! What a unit of work takes, by phase: kept per build and machine, begun by a few short runs, refined by every job
//! that finishes.

use crate::spec::json_numbers::{null_is_zero, nulls_are_zero};
use crate::spec::work_precision::PrecisionMeasured;
use crate::system::process;
use meniscus::scene::PhaseWork;
use meniscus::scene::work::Course;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// Work and the CPU seconds that it took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Units of work.
    pub work: f64,
    /// CPU seconds that the work took.
    pub seconds: f64,
}

/// What was measured of one phase of one family of runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PhaseMeasured {
    /// Kind, dimension and method.
    pub family: String,
    /// Phase of the run.
    pub phase: String,
    /// Work and time of that phase.
    pub measured: Measured,
}

/// What `meniscus calibrate` hands over, in a line each: first the speeds, then the errors.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Measurements {
    /// Speed of this machine, by phase.
    pub phases: Vec<PhaseMeasured>,
    /// Errors of short runs.
    pub precision: Vec<PrecisionMeasured>,
}

/// Everything that was measured on this machine with this build.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Calibration {
    known: BTreeMap<(String, String), Measured>,
}

/// How long a run will take.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TimeForecast {
    /// CPU seconds of the whole run.
    #[serde(deserialize_with = "null_is_zero")]
    pub cpu_s: f64,
    /// Seconds by the clock.
    #[serde(deserialize_with = "null_is_zero")]
    pub wall_s: f64,
    /// CPU seconds of phases that come at milestones, not with every step.
    #[serde(alias = "moments", deserialize_with = "nulls_are_zero")]
    pub milestones: BTreeMap<String, f64>,
    /// Measurements on which it rests.
    pub basis: String,
}

/// The weight that earlier runs keep when a new one comes.
pub const MEMORY: f64 = 0.7;
/// The phase that relates the clock to CPU seconds, for a number of threads.
pub(crate) fn wall_phase(threads: u64) -> String {
    format!("wall@{threads}")
}

/// The first two parts of a family's name.
fn kind_and_dimension(family: &str) -> &str {
    family.match_indices('/').nth(1).map_or(family, |(end, _)| &family[..end])
}

impl Calibration {
    /// From what was kept.
    #[must_use]
    pub fn new(kept: impl IntoIterator<Item = PhaseMeasured>) -> Self {
        Self { known: kept.into_iter().map(|one| ((one.family, one.phase), one.measured)).collect() }
    }

    /// Whether anything is known.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.known.is_empty()
    }

    /// Seconds of a unit: of this family, else of the same kind in the same dimension, else over all.
    #[must_use]
    pub fn seconds_per_unit(&self, family: &str, phase: &str) -> Option<f64> {
        let ratio = |m: Measured| (m.work > 0.0).then_some(m.seconds / m.work);
        if let Some(found) = self.known.get(&(family.to_owned(), phase.to_owned())).and_then(|m| ratio(*m)) {
            return Some(found);
        }
        let over = |is_alike: &dyn Fn(&str) -> bool| {
            let alike = self.known.iter().filter(|((other, name), _)| name == phase && is_alike(other));
            let add = |a: Measured, b: &Measured| Measured { work: a.work + b.work, seconds: a.seconds + b.seconds };
            ratio(alike.map(|(_, m)| m).fold(Measured::default(), add))
        };
        // The same kind in the same dimension by another method is nearer than anything else.
        let nearest = kind_and_dimension(family);
        over(&|other| kind_and_dimension(other) == nearest).or_else(|| over(&|_| true))
    }

    /// The time of a run; None while a phase that it has was never measured.
    #[must_use]
    pub fn time(&self, family: &str, work: &[PhaseWork], threads: u64) -> Option<TimeForecast> {
        let mut forecast = TimeForecast::default();
        for phase in work.iter().filter(|phase| phase.units > 0.0) {
            let seconds = phase.units * self.seconds_per_unit(family, phase.phase)?;
            forecast.cpu_s += seconds;
            if phase.course == Course::Milestones {
                *forecast.milestones.entry(phase.phase.to_owned()).or_insert(0.0) += seconds;
            }
        }
        let clock = self.seconds_per_unit(family, &wall_phase(threads)).unwrap_or(1.0 / threads as f64);
        forecast.wall_s = forecast.cpu_s * clock;
        let is_known = |is_alike: &dyn Fn(&str) -> bool| self.known.keys().any(|(known, _)| is_alike(known));
        let alike = kind_and_dimension(family);
        let of = if is_known(&|known| known == family) {
            family
        } else if is_known(&|known| kind_and_dimension(known) == alike) {
            alike
        } else {
            "other"
        };
        forecast.basis = format!("measured {of} runs of this build on this machine, by phase");
        Some(forecast)
    }
}

/// The name of this machine for calibration: processor and number of cores.
#[must_use]
pub fn machine() -> &'static str {
    static NAME: OnceLock<String> = OnceLock::new();
    NAME.get_or_init(|| {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        format!("{} x {cores}", process::cpu_name().unwrap_or_else(|| "unknown".to_owned()))
    })
}
