//! The work of a run before it is made, by phase: in units that cost about the same within a kind of scene and a
//! dimension, so that a few measured runs tell what a unit takes on a machine.

/// Work of one phase, named as the report names its cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseWork {
    /// Phase.
    pub phase: &'static str,
    /// Units.
    pub units: f64,
    /// When in the run it comes.
    pub course: Course,
}

/// When the work of a phase comes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// With every step, about the same each time.
    EveryStep,
    /// At some moments: errors, frames, the start and the end.
    Moments,
}

impl PhaseWork {
    /// Work that comes with every step.
    #[must_use]
    pub fn every_step(phase: &'static str, units: f64) -> Self {
        Self { phase, units, course: Course::EveryStep }
    }

    /// Work that comes at some moments.
    #[must_use]
    pub fn at_moments(phase: &'static str, units: f64) -> Self {
        Self { phase, units, course: Course::Moments }
    }
}
