//! What is known of the levels of a study that refines, as it stands in the store.

use crate::convergence::Level;
use crate::spec::health::HealthStatus;
use serde::{Deserialize, Serialize};

meniscus::words! {
    /// Whether levels are still made.
    pub enum RefinementState {
        /// the next level is made when the one before has ended
        Open = "open",
        /// no level is made before a resume
        Paused = "paused",
        /// no further level is made
        Ended = "ended",
    }
}

meniscus::words! {
    /// Why no further level is made.
    pub enum RefinementOutcome {
        /// the tolerance is met
        Tolerance = "tolerance",
        /// all levels that were allowed are made
        Levels = "levels",
        /// the next level would cost more than the budget
        Budget = "budget",
        /// the next level would need more memory than there is
        Memory = "memory",
        /// the levels do not converge
        Divergent = "divergent",
        /// a level has failed
        Failed = "failed",
        /// a level or the study was canceled
        Canceled = "canceled",
    }
}

/// What a level has come to. It is kept with the study: the level stays when its job is deleted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MeasuredLevel {
    /// Resolved spacing of the scene: periodic boxes round what was asked for.
    pub spacing: f64,
    /// The quantity.
    pub value: f64,
    /// Size of the exact answer that an error is compared with.
    pub scale: f64,
    /// Order that theory gives for the quantity, where it is known.
    pub theory: Option<f64>,
    /// CPU seconds of the run.
    pub cpu_s: f64,
    /// CPU seconds that it was forecast to take.
    pub forecast_cpu_s: Option<f64>,
    /// Seconds by the clock.
    pub wall_s: f64,
    /// Number of particles.
    pub particles: u64,
    /// Number of steps.
    pub steps: u64,
    /// Whether its results can be trusted.
    pub health: Option<HealthStatus>,
}

impl MeasuredLevel {
    /// A level of which an error and its cost are known, and no more.
    #[must_use]
    pub fn of_error(level: Level, theory: Option<f64>) -> Self {
        Self {
            spacing: level.spacing,
            value: level.value,
            scale: 1.0,
            theory,
            cpu_s: level.cpu_s,
            forecast_cpu_s: None,
            wall_s: 0.0,
            particles: 0,
            steps: 0,
            health: None,
        }
    }
}

impl From<&MeasuredLevel> for Level {
    fn from(measured: &MeasuredLevel) -> Self {
        Self { spacing: measured.spacing, value: measured.value, cpu_s: measured.cpu_s }
    }
}
