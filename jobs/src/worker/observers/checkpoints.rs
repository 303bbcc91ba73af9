//! Checkpoints by the wall clock, by steps, on request, and always of the final state.

use crate::formats::checkpoint::{self, CheckpointError, Counters};
use crate::spec::attempt_files;
use crate::spec::records::CheckpointRecord;
use crate::system::build;
use meniscus::simulation::{Section, Simulation, state_of};
use meniscus::time::Clock;
use serde_json::Value;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use ulid::Ulid;

/// A whole state of a run, with what was written up to it.
pub struct WholeState {
    /// Clock of the state.
    pub clock: Clock,
    /// The state.
    pub state: Section,
    /// Output up to it.
    pub counters: Counters,
}

impl WholeState {
    /// The present state of a simulation.
    #[must_use]
    pub fn of(simulation: &dyn Simulation, counters: Counters) -> Self {
        Self { clock: simulation.clock(), state: state_of(simulation), counters }
    }
}

/// Writes checkpoints when they are due.
pub struct Checkpoints {
    directory: PathBuf,
    job: String,
    body: Value,
    every: Option<Duration>,
    every_steps: Option<u64>,
    last: Instant,
    last_step: Option<u64>,
}

impl Checkpoints {
    /// For an attempt; the clock starts now.
    #[must_use]
    pub fn new(
        directory: PathBuf,
        job: String,
        body: Value,
        every_wall_s: Option<f64>,
        every_steps: Option<u64>,
    ) -> Self {
        let every = every_wall_s.and_then(|s| Duration::try_from_secs_f64(s).ok());
        Self { directory, job, body, every, every_steps, last: Instant::now(), last_step: None }
    }

    /// Whether the last one is of this step.
    #[must_use]
    pub fn has(&self, step: u64) -> bool {
        self.last_step == Some(step)
    }

    /// Whether to write one after this step. The initial state is not worth one.
    #[must_use]
    pub fn is_due(&self, step: u64, wanted: bool) -> bool {
        let by_clock = self.every.is_some_and(|every| self.last.elapsed() >= every);
        let by_steps = self.every_steps.is_some_and(|every| step > 0 && step.is_multiple_of(every));
        (wanted || by_steps || by_clock && step > 0) && self.last_step != Some(step)
    }

    /// Writes and verifies one.
    ///
    /// # Errors
    /// [`CheckpointError`].
    pub fn write(&mut self, whole: WholeState) -> Result<CheckpointRecord, CheckpointError> {
        let WholeState { clock, state, counters } = whole;
        let folder = self.directory.join(attempt_files::CHECKPOINTS);
        std::fs::create_dir_all(&folder)?;
        let is_before_output = counters.is_before_output;
        let mark = if is_before_output { attempt_files::UNMEASURED } else { "" };
        let name = format!("{:012}{mark}.{}", clock.step, attempt_files::CHECKPOINT_ENDING);
        let meta = checkpoint::meta(&self.job, &self.body, clock.step, clock.time, counters);
        let (sha256, size_bytes) = checkpoint::write_verified(&folder.join(&name), meta, &state)?;
        self.last = Instant::now();
        if !is_before_output {
            self.last_step = Some(clock.step);
        }
        Ok(CheckpointRecord {
            id: format!("ckpt_{}", Ulid::generate()),
            path: format!("{}/{name}", attempt_files::CHECKPOINTS),
            step: clock.step,
            time: clock.time,
            size_bytes,
            sha256,
            isa: build::isa(),
            build: build::name(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_due_by_the_clock_by_steps_and_on_request_but_once_a_step() {
        let new = |every, steps| Checkpoints::new(PathBuf::new(), String::new(), Value::Null, every, steps);
        let (always, later) = (new(Some(0.0), None), new(Some(3600.0), None));
        assert!(always.is_due(1, false) && !later.is_due(1, false) && later.is_due(1, true));
        assert!(!always.is_due(0, false), "the initial state is not worth one");
        let mut by_steps = new(None, Some(20));
        assert_eq!((0..=60).filter(|step| by_steps.is_due(*step, false)).collect::<Vec<_>>(), [20, 40, 60]);
        by_steps.last_step = Some(40);
        assert!(!by_steps.is_due(40, true));
    }
}
