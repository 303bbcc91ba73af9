//! What every simulation has beside its method: its steps, their costs, and what was noticed on the way.

use super::finding::Finding;
use super::section::{LoadError, Section};
use super::{Phases, StepError};
use crate::geometry::Vector;
use crate::time::{Clock, FixedStep, Pace};
use std::collections::BTreeMap;

/// The course of a run: where it is, what it cost and what it noticed.
#[derive(Debug)]
pub struct Course {
    /// Length and number of the steps.
    pub pace: Pace,
    /// Number of steps done.
    pub step: u64,
    /// CPU seconds by phase.
    pub phases: Phases,
    /// Findings that were not taken yet.
    pub findings: Vec<Finding>,
    /// Outcomes of automatic choices, and their reasons.
    pub method: BTreeMap<&'static str, String>,
}

impl Course {
    /// The course of a run at its start.
    #[must_use]
    pub fn new(pace: Pace, phases: Phases, method: BTreeMap<&'static str, String>) -> Self {
        Self { pace, step: 0, phases, findings: Vec::new(), method }
    }

    /// Step number and scene time.
    #[must_use]
    pub fn clock(&self) -> Clock {
        self.pace.clock(self.step)
    }

    /// The clock after the next step.
    #[must_use]
    pub fn next(&self) -> Clock {
        self.pace.clock(self.step + 1)
    }

    /// The clock at the end of the run.
    #[must_use]
    pub fn end(&self) -> Clock {
        self.pace.clock(self.pace.last)
    }

    /// The equal steps of a run that began at time 0.
    #[must_use]
    pub fn fixed(&self) -> FixedStep {
        FixedStep { time_step: self.pace.time_step, steps: self.pace.last }
    }

    /// Saves the clock.
    pub fn save(&self, state: &mut Section) {
        state.put_component("clock", &self.clock());
    }

    /// The clock of a state.
    ///
    /// # Errors
    /// [`LoadError::Beyond`] where it lies behind the end of this run.
    pub fn check(&self, state: &Section) -> Result<Clock, LoadError> {
        let clock: Clock = state.component("clock")?;
        if clock.step > self.pace.last {
            return Err(LoadError::Beyond { step: clock.step, last: self.pace.last });
        }
        Ok(clock)
    }
}

/// An error when a number of a field is not finite.
///
/// # Errors
/// [`StepError::NonFinite`] with the first such particle.
pub fn check_finite(field: &'static str, values: &[f64], at: Clock) -> Result<(), StepError> {
    first(field, values.iter().position(|value| !value.is_finite()), at)
}

/// An error when a component of a vector field is not finite.
///
/// # Errors
/// [`StepError::NonFinite`] with the first such particle.
pub fn check_finite_vectors<const D: usize>(
    field: &'static str,
    values: &[Vector<D>],
    at: Clock,
) -> Result<(), StepError> {
    first(field, values.iter().position(|value| !is_finite(value)), at)
}

/// An error when there is a particle with a broken number.
///
/// # Errors
/// [`StepError::NonFinite`].
pub fn first_broken(found: Option<(&'static str, usize)>, at: Clock) -> Result<(), StepError> {
    found.map_or(Ok(()), |(field, particle)| first(field, Some(particle), at))
}

fn first(field: &'static str, particle: Option<usize>, Clock { step, time }: Clock) -> Result<(), StepError> {
    particle.map_or(Ok(()), |particle| Err(StepError::NonFinite { field, particle, step, time }))
}

/// Whether all components are finite.
#[must_use]
pub fn is_finite<const D: usize>(vector: &Vector<D>) -> bool {
    vector.iter().all(|component| component.is_finite())
}
