//! What watches a run and writes its output: frames, series, checkpoints, progress, and the ear for requests.
//!
//! They look and never touch. At every step the order is: frame, series row, checkpoint (so that its counters cover
//! the output of its own step), progress, request to stop.

pub mod checkpoints;
pub mod control;
pub mod frames;
pub mod progress;
pub mod series;

pub use control::Control;

use crate::formats::checkpoint::Counters;
use crate::spec::health::FindingLog;
use crate::spec::records::{Record, RecordSink};
use crate::system::breakpoints::pass;
use crate::system::process::free_space;
use crate::worker::log::Log;
use checkpoints::Checkpoints;
use frames::Frames;
use meniscus::simulation::run::ObserverError;
use meniscus::simulation::{Finding, Observer, Request, Simulation};
use progress::ProgressMeter;
use series::Series;
use std::path::PathBuf;

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
}

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
        }
    }
}

impl Observer for Observers<'_> {
    fn observe(&mut self, simulation: &dyn Simulation) -> Result<Request, ObserverError> {
        let step = simulation.clock().step;
        let finished = simulation.is_finished();
        let is_repeat = self.restored.take() == Some(step);
        if !is_repeat {
            self.progress.timed("output", || -> Result<(), ObserverError> {
                if let Some(frame) = self.frames.observe(simulation)? {
                    self.sink.put(&Record::File(frame), false)?;
                }
                self.series.observe(simulation)?;
                Ok(())
            })?;
        }
        let is_short = || free_space(&self.directory).is_some_and(|free| free < self.reserve_bytes);
        self.is_starved = !finished && self.reserve_bytes > 0 && is_short();
        let stopping = (self.control.is_pausing() || self.is_starved) && !finished;
        let wanted = self.control.take_checkpoint_request() || stopping || finished;
        if !is_repeat && self.checkpoints.is_due(step, wanted) {
            self.series.sync()?;
            let counters = self.counters(simulation);
            let checkpoints = &mut self.checkpoints;
            let record = self.progress.timed("checkpoint", || checkpoints.write(simulation, counters))?;
            pass("checkpoint/unrecorded");
            self.sink.put(&Record::Checkpoint(record), true)?;
            pass("checkpoint/recorded");
        }
        if let Some(progress) = self.progress.observe(simulation, &self.findings, finished || stopping) {
            self.sink.put(&Record::Progress(progress), false)?;
        }
        let stop = stopping || self.control.interrupt().is_raised();
        Ok(if stop { Request::Stop } else { Request::Continue })
    }

    fn notice(&mut self, finding: &Finding) -> Result<(), ObserverError> {
        self.findings.push(finding.clone());
        self.log.line(&finding.to_string());
        Ok(self.sink.put(&Record::Finding(finding.clone()), false)?)
    }
}
