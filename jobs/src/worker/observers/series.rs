//! The series: observables over time, one CSV file that each attempt continues from its checkpoint.

use super::frames::fixed_step;
use crate::formats::csv;
use crate::spec::attempt_files;
use crate::system::artifacts;
use meniscus::simulation::run::ObserverError;
use meniscus::simulation::{OutputPlan, Simulation};
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Writes rows when they are due.
pub struct Series {
    file: File,
    epoch: u64,
    bytes: u64,
    plan: OutputPlan,
}

impl Series {
    /// A series for an attempt; `earlier` is the file of an earlier attempt and how much of it holds.
    ///
    /// # Errors
    /// When a file cannot be read or written.
    pub fn open(directory: &Path, epoch: u64, plan: OutputPlan, earlier: Option<(PathBuf, u64)>) -> io::Result<Self> {
        let path = directory.join(attempt_files::SERIES);
        let mut held = Vec::new();
        if let Some((earlier, bytes)) = earlier
            && bytes > 0
        {
            File::open(earlier)?.take(bytes).read_to_end(&mut held)?;
            if held.len() as u64 != bytes {
                return Err(io::Error::new(
                    io::ErrorKind::UnexpectedEof,
                    "the earlier series is shorter than its checkpoint says",
                ));
            }
        }
        artifacts::write(&path, &held)?;
        let file = OpenOptions::new().append(true).open(path)?;
        Ok(Self { file, epoch, bytes: held.len() as u64, plan })
    }

    /// The attempt that this file belongs to.
    #[must_use]
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Bytes so far.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Makes all rows durable.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn sync(&self) -> io::Result<()> {
        self.file.sync_data()
    }

    /// Writes the row of this step, if it is due.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn observe(&mut self, simulation: &dyn Simulation) -> Result<(), ObserverError> {
        let is_first = self.bytes == 0;
        if !is_first && !self.plan.is_series_due(&fixed_step(simulation), simulation.clock().step) {
            return Ok(());
        }
        let (names, values): (Vec<&str>, Vec<f64>) =
            simulation.observables().into_iter().map(|(quantity, value)| (quantity.name, value)).unzip();
        let mut text = if is_first { csv::header(&names) } else { String::new() };
        text += &csv::row(&values);
        // One write, so that a reader sees whole rows.
        self.file.write_all(text.as_bytes())?;
        self.bytes += text.len() as u64;
        Ok(())
    }
}
