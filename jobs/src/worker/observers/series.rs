//! The series: observables over time, one CSV file that each attempt continues from its checkpoint.

use super::frames::fixed_step;
use crate::formats::csv;
use crate::spec::attempt_files;
use crate::system::artifacts;
use meniscus::simulation::run::ObserverError;
use meniscus::simulation::{Measures, OutputPlan, Simulation};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Writes rows when they are due.
pub struct Series {
    file: File,
    epoch: u64,
    bytes: u64,
    plan: OutputPlan,
    measures: Measures,
    directory: PathBuf,
    /// Whether the rows before have the columns of this attempt.
    has_columns: bool,
}

impl Series {
    /// A series for an attempt; `earlier` is the file of an earlier attempt and how much of it holds.
    ///
    /// # Errors
    /// When a file cannot be read or written.
    pub fn open(
        directory: &Path,
        epoch: u64,
        plan: OutputPlan,
        measures: Measures,
        earlier: Option<(PathBuf, u64)>,
    ) -> io::Result<Self> {
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
        let directory = directory.to_owned();
        Ok(Self { file, epoch, bytes: held.len() as u64, plan, measures, directory, has_columns: false })
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

    /// Gives the earlier rows the columns of this attempt, where an amendment changed what is measured: columns that are new have
    /// no number there.
    fn keep_columns(&mut self, header: &str) -> io::Result<()> {
        if self.has_columns {
            return Ok(());
        }
        self.has_columns = true;
        let path = self.directory.join(attempt_files::SERIES);
        let held = fs::read_to_string(&path)?;
        if held.starts_with(header) {
            return Ok(());
        }
        let table = csv::Table::from_text(&held);
        let columns: Vec<Vec<f64>> = header.trim_end().split(',').map(|name| table.column(name).collect()).collect();
        let mut text = header.to_owned();
        for row in 0..table.rows.len() {
            text += &csv::row(&columns.iter().map(|column| column[row]).collect::<Vec<_>>());
        }
        artifacts::write(&path, text.as_bytes())?;
        self.file = OpenOptions::new().append(true).open(path)?;
        self.bytes = text.len() as u64;
        Ok(())
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
        let (mut names, mut values): (Vec<&str>, Vec<f64>) =
            simulation.observables().into_iter().map(|(quantity, value)| (quantity.name, value)).unzip();
        names.extend(self.measures.columns());
        values.extend(self.measures.take(simulation));
        let header = csv::header(&names);
        if !is_first {
            self.keep_columns(&header)?;
        }
        let mut text = if is_first { header } else { String::new() };
        text += &csv::row(&values);
        // One write, so that a reader sees whole rows.
        self.file.write_all(text.as_bytes())?;
        self.bytes += text.len() as u64;
        Ok(())
    }
}
