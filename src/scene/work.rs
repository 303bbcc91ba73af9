//! The work of a run before it is made, by phase. A unit of work costs about the same within a kind of scene and a dimension,
//! so that a few measured runs tell what it takes on a machine.

/// Work of one phase, named as the report names its cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseWork {
    /// Name of the phase, as in the costs of reports.
    pub phase: &'static str,
    /// Amount of work, in units that cost about the same within a family of runs.
    pub units: f64,
    /// When in the run it comes.
    pub course: Course,
}

/// When the work of a phase comes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// In every step, about the same amount each time.
    EveryStep,
    /// At milestones: errors, frames, the start and the end.
    Milestones,
}

impl PhaseWork {
    /// Work that comes in every step.
    #[must_use]
    pub fn every_step(phase: &'static str, units: f64) -> Self {
        Self { phase, units, course: Course::EveryStep }
    }

    /// Work that comes at milestones.
    #[must_use]
    pub fn at_milestones(phase: &'static str, units: f64) -> Self {
        Self { phase, units, course: Course::Milestones }
    }
}
