//! `meniscus run` with a verification case: its runs one after another, then its values beside its targets.

use super::{RunError, exit_code, resolve, start};
use meniscus_jobs::spec::report::RunReport;
use meniscus_jobs::verify::case::job_body;
use meniscus_jobs::verify::measure::FinishedRun;
use meniscus_jobs::verify::{Case, Outcome};
use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

/// Runs every run of a case into the folder of its name below `out` and prints the value of each target beside what is to
/// be reached. Fails when a run fails or a target is missed.
pub(super) fn run(file: &Path, text: &[u8], out: &Path, threads: Option<usize>) -> Result<ExitCode, RunError> {
    let case = Case::parse(&file.display().to_string(), text)?;
    // Every run is checked before the first one starts.
    let mut resolved = Vec::new();
    for (name, run) in &case.runs {
        let body = resolve(&job_body(run), threads).map_err(|error| match error {
            RunError::Invalid(text) => RunError::Invalid(format!("run {name}: {text}")),
            other => other,
        })?;
        resolved.push((name, body));
    }
    fs::create_dir_all(out)?;
    if fs::read_dir(out)?.next().is_some() {
        return Err(RunError::NotEmpty(out.display().to_string()));
    }
    writeln!(io::stdout(), "{}\n{}", case.title, case.source)?;
    for (name, body) in resolved {
        writeln!(io::stdout(), "\nrun {name}")?;
        if !start(&body, Vec::new(), &out.join(name))? {
            return Ok(ExitCode::FAILURE);
        }
    }
    let mut output = io::stdout().lock();
    writeln!(output, "\n{:<62} {:>20}  {:>18} {:>10}", "target", "paper", "to reach", "measured")?;
    let mut all_met = true;
    for target in &case.targets {
        let outcome =
            Outcome::of_target("", &case, target, |run, body| FinishedRun::new(body, read_report(&out.join(run))?));
        all_met &= outcome.is_met;
        writeln!(output, "{}", outcome.line())?;
    }
    Ok(exit_code(all_met))
}

fn read_report(directory: &Path) -> Result<RunReport, String> {
    let bytes = fs::read(directory.join("report.json")).map_err(|error| error.to_string())?;
    serde_json::from_slice(&bytes).map_err(|error| error.to_string())
}
