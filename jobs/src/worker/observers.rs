//! What watches a run and writes its output: frames, series, checkpoints, progress, and the ear for requests.
//!
//! They look and never touch. At every step the order is: frame, series row, checkpoint (so that its counters cover
//! the output of its own step), progress, request to stop. Before a measurement the state is kept: a measurement, a step or a
//! frame that a request to pause drops is made again from there.

pub mod checkpoints;
pub mod control;
pub mod frames;
pub mod progress;
pub mod series;

pub use control::Control;

use crate::formats::checkpoint::Counters;
use crate::spec::health::FindingLog;
use crate::spec::records::{Progress, Record, RecordSink};
use crate::system::breakpoints::pass;
use crate::system::process::free_space;
use crate::worker::log::Log;
use checkpoints::{Checkpoints, WholeState};
use frames::{FrameOutcome, Frames};
use meniscus::simulation::run::ObserverError;
use meniscus::simulation::{Finding, Observer, Request, Simulation};
use progress::ProgressMeter;
use series::Series;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// All observers of one attempt.
pub struct Observers<'a> {
    /// Frames and their index.
    pub frames: Frames,
    /// Writer of the series.
    pub series: Series,
    /// Writer of checkpoints.
    pub checkpoints: Checkpoints,
    /// Progress and cost.
    pub progress: ProgressMeter,
    /// What was noticed so far.
    pub findings: FindingLog,
    /// The attempt's log.
    pub log: &'a Log,
    /// Requests from outside.
    pub control: &'a Control,
    /// Where records go.
    pub sink: &'a mut dyn RecordSink,
    /// Where the attempt writes, and the free space there that it leaves untouched.
    pub directory: PathBuf,
    /// Free space that the attempt leaves untouched, in bytes.
    pub reserve_bytes: u64,
    /// Whether the run stops because the reserve is reached.
    pub is_starved: bool,
    /// A restored step whose output was written before; None after it has passed.
    pub restored: Option<u64>,
    /// The last whole state, where no checkpoint holds it, and when it was kept.
    pub kept: Option<(WholeState, Instant)>,
}

/// Age of the kept state from which on a step that begins keeps a new one: a step that is dropped on request costs no more.
const KEPT_STATE_AGE: Duration = Duration::from_millis(500);
/// Least time between a record and one that tells of a measurement.
const MEASUREMENT_INTERVAL: Duration = Duration::from_millis(100);

impl Observers<'_> {
    /// What has been written and spent so far.
    #[must_use]
    pub fn counters(&self, simulation: &dyn Simulation) -> Counters {
        Counters {
            frames: self.frames.written().to_vec(),
            frames_before: self.frames.before(),
            series_epoch: self.series.epoch(),
            series_bytes: self.series.bytes(),
            phases: self.progress.phases(simulation),
            findings: self.findings.findings().to_vec(),
            is_before_output: false,
        }
    }

    /// Frame and series row of this step, where they are due; false where they were dropped on request.
    fn write_output(&mut self, simulation: &dyn Simulation) -> Result<bool, ObserverError> {
        let is_dropped = || self.control.interrupt().is_raised();
        let (frames, series, sink) = (&mut self.frames, &mut self.series, &mut *self.sink);
        self.progress.timed("output", || {
            match frames.observe(simulation, is_dropped)? {
                FrameOutcome::NotDue => {}
                FrameOutcome::Written(frame) => sink.put(&Record::File(frame), false)?,
                FrameOutcome::Dropped => return Ok(false),
            }
            series.observe(simulation)?;
            Ok(true)
        })
    }

    /// Keeps the present state, to go back to it when what begins now is dropped.
    fn keep(&mut self, simulation: &dyn Simulation, is_before_output: bool) {
        let counters = Counters { is_before_output, ..self.counters(simulation) };
        self.kept = Some((WholeState::of(simulation, counters), Instant::now()));
    }

    /// Writes a checkpoint.
    fn write_checkpoint(&mut self, whole: WholeState) -> Result<(), ObserverError> {
        self.series.sync()?;
        let checkpoints = &mut self.checkpoints;
        let record = self.progress.timed("checkpoint", || checkpoints.write(whole))?;
        pass("checkpoint/unrecorded");
        self.sink.put(&Record::Checkpoint(record), true)?;
        pass("checkpoint/recorded");
        Ok(())
    }

    /// Writes a checkpoint of the last whole state after a step or a measurement was dropped. Without one, the last checkpoint
    /// or the start of the scene is as near.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn rescue(&mut self) -> Result<(), ObserverError> {
        match self.kept.take() {
            Some((whole, _)) if whole.clock.step > 0 => {
                self.log.line(&format!("the step after step {} is dropped on request", whole.clock.step));
                self.write_checkpoint(whole)
            }
            _ => Ok(()),
        }
    }
}

impl Observer for Observers<'_> {
    fn observe(&mut self, simulation: &dyn Simulation) -> Result<Request, ObserverError> {
        let step = simulation.clock().step;
        let finished = simulation.is_finished();
        let is_repeat = self.restored.take() == Some(step);
        if !is_repeat && !self.write_output(simulation)? {
            let counters = Counters { is_before_output: true, ..self.counters(simulation) };
            self.write_checkpoint(WholeState::of(simulation, counters))?;
            return Ok(Request::Stop);
        }
        let is_short = || free_space(&self.directory).is_some_and(|free| free < self.reserve_bytes);
        self.is_starved = !finished && self.reserve_bytes > 0 && is_short();
        let stopping = (self.control.is_pausing() || self.is_starved) && !finished;
        let wanted = self.control.take_checkpoint_request() || stopping || finished;
        if !is_repeat && self.checkpoints.is_due(step, wanted) {
            let counters = self.counters(simulation);
            self.write_checkpoint(WholeState::of(simulation, counters))?;
        }
        if let Some(progress) = self.progress.observe(simulation, &self.findings, finished || stopping) {
            self.sink.put(&Record::Progress(progress), false)?;
        }
        if self.checkpoints.has(step) || is_repeat {
            self.kept = None;
        } else if self.kept.as_ref().is_none_or(|(_, at)| at.elapsed() >= KEPT_STATE_AGE) {
            self.keep(simulation, false);
        }
        let stop = stopping || self.control.is_canceled();
        Ok(if stop { Request::Stop } else { Request::Continue })
    }

    fn before_measurement(&mut self, simulation: &dyn Simulation) -> Result<Request, ObserverError> {
        // Fast steps with a measurement each would write little else.
        let must = self.progress.is_silent_for(MEASUREMENT_INTERVAL);
        if let Some(progress) = self.progress.observe(simulation, &self.findings, must) {
            self.sink.put(&Record::Progress(Progress { phase: "measuring".to_owned(), ..progress }), false)?;
        }
        let step = simulation.clock().step;
        let is_restored = self.restored == Some(step);
        let stopping = self.control.is_pausing();
        if !is_restored {
            let is_wanted = self.control.take_checkpoint_request() || stopping;
            self.keep(simulation, true);
            if self.checkpoints.is_due(step, is_wanted)
                && let Some((whole, _)) = self.kept.take()
            {
                self.write_checkpoint(whole)?;
            }
        }
        Ok(if stopping || self.control.is_canceled() { Request::Stop } else { Request::Continue })
    }

    fn notice(&mut self, finding: &Finding) -> Result<(), ObserverError> {
        self.findings.push(finding.clone());
        self.log.line(&finding.to_string());
        Ok(self.sink.put(&Record::Finding(finding.clone()), false)?)
    }
}
