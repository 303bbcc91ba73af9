//! Where the runs of a verification are kept. Runs of this build that are already there are not repeated.

use super::bad_case::Fate;
use super::measure::FinishedRun;
use crate::spec::attempt_files;
use crate::spec::records::Verdict;
use crate::spec::report::RunReport;
use crate::system::build;
use crate::system::digest;
use crate::worker::local_run::{self, Keep, Refused};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// The directory of the runs of this build.
pub(super) struct Workspace {
    directory: PathBuf,
}

impl Workspace {
    /// Below a directory that builds share: runs of another build are not taken for those of this one.
    pub(super) fn new(runs: &Path) -> Self {
        let own = std::env::current_exe().ok().and_then(|path| digest::of_file(&path).ok());
        let build = own.map_or_else(build::name, |(digest, _)| digest[..16].to_owned());
        Self { directory: runs.join(build) }
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

    /// The directory of a run of this build: an earlier one, or one made now.
    pub(super) fn run(&self, body: &Value, keep: Keep) -> Result<PathBuf, String> {
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
