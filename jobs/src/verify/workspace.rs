//! Where the runs of a verification are kept. Runs of this build that are already there are not repeated.

use super::bad_case::Fate;
use super::measure::FinishedRun;
use crate::convergence::Level;
use crate::spec::attempt_files;
use crate::spec::records::Verdict;
use crate::spec::report::RunReport;
use crate::spec::work_precision::PrecisionMeasured;
use crate::system::build;
use crate::system::digest;
use crate::worker::calibration;
use crate::worker::local_run::{self, Ended, Keep, Refused};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The directory of the runs of this build.
pub(super) struct Workspace {
    directory: PathBuf,
    /// What the short runs of `meniscus calibrate` say of errors, once they are asked for.
    precision: OnceLock<Vec<PrecisionMeasured>>,
}

impl Workspace {
    /// Below a directory that builds share: runs of another build are not taken for those of this one.
    pub(super) fn new(runs: &Path) -> Self {
        let own = std::env::current_exe().ok().and_then(|path| digest::of_file(&path).ok());
        let build = own.map_or_else(build::name, |(digest, _)| digest[..16].to_owned());
        Self { directory: runs.join(build), precision: OnceLock::new() }
    }

    /// Levels that the short runs of `meniscus calibrate` tell, the coarsest first; none where these cannot be made.
    pub(super) fn precision(&self, name: &str, quantity: &str, norm: &str) -> Vec<Level> {
        let measured = self.precision.get_or_init(|| {
            let failed = |error: &str| tracing::warn!(error, "a short run for the precision failed");
            calibration::precision_here(&self.directory.join("precision"), 1, &failed).unwrap_or_else(|error| {
                failed(&error);
                Vec::new()
            })
        });
        let is_asked = |row: &&PrecisionMeasured| row.problem == name && row.quantity == quantity && row.norm == norm;
        let mut levels: Vec<Level> = measured
            .iter()
            .filter(is_asked)
            .map(|row| Level { spacing: row.spacing, value: row.error, cpu_s: row.cpu_s })
            .collect();
        levels.sort_by(|a, b| b.spacing.total_cmp(&a.spacing));
        levels
    }

    /// A finished run of a job body: an earlier one with this build, or one made now.
    pub(super) fn finish(&self, body: &Value) -> Result<FinishedRun, String> {
        let directory = self.run(body, Keep::Report)?;
        let report = read_report(&directory).ok_or_else(|| "the run left no report".to_owned())?;
        FinishedRun::new(body, report)
    }

    /// What becomes of a run, and its report where it comes to its end.
    pub(super) fn fate(&self, body: &Value, expected: Option<&Fate>) -> (Fate, Option<RunReport>) {
        let directory = self.directory_of(body, Keep::Report);
        if let Some(report) = read_report(&directory) {
            return (Fate::of_report(&report, expected), Some(report));
        }
        let fate = match local_run::run_to_verdict(body, &directory, 1, Keep::Report) {
            Err(Refused { pointer, .. }) => Fate::Refused(pointer),
            Ok((_, Verdict::Failed { reason, .. })) => Fate::Ended(reason.word().to_owned()),
            Ok(_) => match read_report(&directory) {
                Some(report) => return (Fate::of_report(&report, expected), Some(report)),
                None => Fate::Ended("no report".to_owned()),
            },
        };
        (fate, None)
    }

    /// The directory of a run of this build.
    fn directory_of(&self, body: &Value, keep: Keep) -> PathBuf {
        let key = format!("{body} {keep:?}");
        self.directory.join(&digest::of_bytes(key.as_bytes())[..16])
    }

    /// CPU seconds of a run that is made once more.
    pub(super) fn time_again(&self, body: &Value) -> Result<f64, Ended> {
        let directory = self.directory.join("again");
        local_run::run(body, &directory, 1, Keep::Report)?;
        let lacking = || Ended { reason: None, message: "the run left no report".to_owned() };
        Ok(read_report(&directory).ok_or_else(lacking)?.cost.cpu_s)
    }

    /// The directory of a run of this build: an earlier one, or one made now.
    pub(super) fn run(&self, body: &Value, keep: Keep) -> Result<PathBuf, Ended> {
        let directory = self.directory_of(body, keep);
        if read_report(&directory).is_none() {
            local_run::run(body, &directory, 1, keep)?;
        }
        Ok(directory)
    }
}

fn read_report(directory: &Path) -> Option<RunReport> {
    serde_json::from_slice(&fs::read(directory.join(attempt_files::REPORT)).ok()?).ok()
}
