//! Frames: one closed VTKHDF file each, and ParaView's index of them.

use crate::formats::{frame_index, vtkhdf};
use crate::spec::attempt_files;
use crate::spec::records::FileRecord;
use crate::system::artifacts;
use crate::system::digest;
use meniscus::simulation::run::ObserverError;
use meniscus::simulation::{OutputPlan, Selection, Simulation};
use meniscus::time::FixedStep;
use std::path::PathBuf;

/// What became of the frame of a step.
pub enum FrameOutcome {
    /// None is due.
    NotDue,
    /// It stands in place.
    Written(FileRecord),
    /// It was dropped on request.
    Dropped,
}

/// Writes frames when they are due.
pub struct Frames {
    directory: PathBuf,
    epoch: u64,
    plan: OutputPlan,
    chosen: Vec<String>,
    written: Vec<(u64, FileRecord)>,
    before: u64,
    /// The first look of a run that does not continue its own: its state is always a frame.
    is_first: bool,
}

impl Frames {
    /// For an attempt; `written` are the frames that earlier attempts wrote, `before` those of earlier jobs.
    #[must_use]
    pub fn new(
        directory: PathBuf,
        epoch: u64,
        plan: OutputPlan,
        chosen: Vec<String>,
        written: Vec<(u64, FileRecord)>,
        before: u64,
    ) -> Self {
        Self { directory, epoch, plan, chosen, is_first: written.is_empty(), written, before }
    }

    /// Frames of this job so far, with the attempt that wrote each.
    #[must_use]
    pub fn written(&self) -> &[(u64, FileRecord)] {
        &self.written
    }

    /// Frames of earlier jobs.
    #[must_use]
    pub fn before(&self) -> u64 {
        self.before
    }

    /// Writes the frame of this step, if it is due. One that `is_dropped` tells to drop may be computed half-way.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn observe(
        &mut self,
        simulation: &dyn Simulation,
        is_dropped: impl Fn() -> bool,
    ) -> Result<FrameOutcome, ObserverError> {
        let clock = simulation.clock();
        let is_due = self.plan.is_frame_due(&fixed_step(simulation), clock.step) || simulation.is_finished();
        if !self.is_first && !is_due {
            return Ok(FrameOutcome::NotDue);
        }
        let name = {
            let number = self.before + self.written.len() as u64;
            format!("{}/{number:06}.{}", attempt_files::FRAMES, attempt_files::FRAME_ENDING)
        };
        let path = self.directory.join(&name);
        std::fs::create_dir_all(self.directory.join(attempt_files::FRAMES))?;
        let fields = simulation.fields(Selection::Named(&self.chosen));
        if is_dropped() {
            return Ok(FrameOutcome::Dropped);
        }
        self.is_first = false;
        vtkhdf::write_frame(&artifacts::unfinished(&path), &fields, clock.time, clock.step)?;
        artifacts::finish(&path)?;
        let (sha256, size_bytes) = digest::of_file(&path)?;
        let frame = FileRecord {
            path: name,
            size_bytes,
            sha256,
            media_type: attempt_files::HDF5_MEDIA_TYPE.to_owned(),
            time: Some(clock.time),
            step: Some(clock.step),
        };
        self.written.push((self.epoch, frame.clone()));
        Ok(FrameOutcome::Written(frame))
    }

    /// Writes the index of all frames. While a job runs the service derives it from the published frames; the end of
    /// the run makes it a file.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_index(&self) -> Result<FileRecord, ObserverError> {
        let text = frame_index::text(self.written.iter().map(|(_, frame)| (frame.path.as_str(), frame.time)));
        artifacts::write(&self.directory.join(frame_index::PATH), text.as_bytes())?;
        Ok(FileRecord::from_file(&self.directory, frame_index::PATH, frame_index::MEDIA_TYPE)?)
    }
}

/// The steps of a simulation, for the output plan.
#[must_use]
pub fn fixed_step(simulation: &dyn Simulation) -> FixedStep {
    let end = simulation.end();
    FixedStep { time_step: end.time / end.step.max(1) as f64, steps: end.step }
}
