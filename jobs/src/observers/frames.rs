//! Frames: one closed VTKHDF file each, and ParaView's index of them.

use crate::artifacts;
use crate::digest;
use crate::formats::vtkhdf;
use crate::records::FileRecord;
use meniscus::simulation::run::ObserverError;
use meniscus::simulation::{OutputPlan, Simulation};
use meniscus::time::FixedStep;
use serde_json::json;
use std::path::PathBuf;

/// Media type of HDF5 files.
pub const HDF5: &str = "application/x-hdf5";
/// Path of the index.
pub const INDEX: &str = "frames.vtkhdf.series";

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

    /// Writes the frame of this step, if it is due; returns the files that are new.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn observe(&mut self, simulation: &dyn Simulation) -> Result<Vec<FileRecord>, ObserverError> {
        let clock = simulation.clock();
        if !self.is_first && !self.plan.is_frame_due(&fixed_step(simulation), clock.step) {
            return Ok(Vec::new());
        }
        self.is_first = false;
        let name = format!("frames/{:06}.vtkhdf", self.before + self.written.len() as u64);
        let path = self.directory.join(&name);
        std::fs::create_dir_all(self.directory.join("frames"))?;
        vtkhdf::write_frame(&artifacts::unfinished(&path), &simulation.fields(), &self.chosen, clock.time, clock.step)?;
        artifacts::finish(&path)?;
        let (sha256, size_bytes) = digest::of_file(&path)?;
        let frame = FileRecord {
            path: name,
            stored: None,
            size_bytes,
            sha256,
            media_type: HDF5.to_owned(),
            time: Some(clock.time),
            step: Some(clock.step),
        };
        self.written.push((self.epoch, frame.clone()));
        Ok(vec![frame, self.write_index()?])
    }

    /// Writes the index of all frames so far.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_index(&self) -> Result<FileRecord, ObserverError> {
        let files: Vec<_> = self.written.iter().map(|(_, f)| json!({"name": f.path, "time": f.time})).collect();
        let index = json!({"file-series-version": "1.0", "files": files});
        let text = index.to_string();
        // What is published never changes under its stored name; the plain name beside it is for people who open the
        // directory itself.
        let stored = format!("index/{:06}.series", self.written.len());
        std::fs::create_dir_all(self.directory.join("index"))?;
        artifacts::write(&self.directory.join(&stored), text.as_bytes())?;
        artifacts::write(&self.directory.join(INDEX), text.as_bytes())?;
        let record = artifacts::record(&self.directory, &stored, "application/json")?;
        Ok(FileRecord { path: INDEX.to_owned(), stored: Some(stored), ..record })
    }
}

/// The steps of a simulation, for the output plan.
#[must_use]
pub fn fixed_step(simulation: &dyn Simulation) -> FixedStep {
    let end = simulation.end();
    FixedStep { time_step: end.time / end.step.max(1) as f64, steps: end.step }
}
