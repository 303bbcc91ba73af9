//! What came of the accuracy that a job was asked for, at the end of its run.

use crate::formats::quantity_reader::{self, RunResults};
use crate::spec::accuracy::{ChosenAccuracy, KnownLevel, Reached};
use crate::spec::attempt_files;
use crate::spec::health::FindingLog;
use crate::spec::report::RunReport;
use crate::worker::observers::Observers;
use meniscus::scene::Scene;
use meniscus::simulation::Finding;
use meniscus::simulation::run::{Observer, ObserverError};
use std::borrow::Cow;
use std::path::Path;

/// The report of a run at its end with what it has reached. A tolerance that was missed is a finding.
///
/// # Errors
/// When a file cannot be read or a record cannot be written.
pub fn report(
    chosen: &ChosenAccuracy,
    directory: &Path,
    scene: &dyn Scene,
    observers: &mut Observers,
    compose: impl Fn(&FindingLog) -> RunReport,
) -> Result<RunReport, ObserverError> {
    let plain = compose(&observers.findings);
    let series = std::fs::read_to_string(directory.join(attempt_files::SERIES))?;
    let reached = match judge(chosen, &plain, &series, scene) {
        Ok(reached) => reached,
        Err(cause) => {
            observers.log.line(&format!("the accuracy cannot be told: {cause}"));
            return Ok(plain);
        }
    };
    let time = plain.errors.iter().map(|error| error.time).fold(0.0, f64::max);
    if let Some(finding) = missed(&reached, (plain.cost.steps, time)) {
        observers.notice(&finding)?;
    }
    Ok(RunReport { accuracy: Some(reached.report), ..compose(&observers.findings) })
}

/// What a run has reached, by its report and its series.
///
/// # Errors
/// A sentence that says what they lack.
fn judge(chosen: &ChosenAccuracy, report: &RunReport, series: &str, scene: &dyn Scene) -> Result<Reached, String> {
    let quantity = chosen.quantity().ok_or("the quantity of the accuracy cannot be read")?;
    let report_json = serde_json::to_value(report).map_err(|error| error.to_string())?;
    let value = quantity_reader::read(&quantity, &RunResults { report, report_json: &report_json, series })?;
    let scale = if chosen.relative { quantity_reader::scale(&quantity, report)? } else { 1.0 };
    let theory = quantity.order(scene);
    let spacing = scene.spacing().ok_or("the spacing of the scene is not known")?;
    Ok(chosen.reached(KnownLevel { spacing, value, cpu_s: report.cost.cpu_s }, scale, theory))
}

/// The finding of a tolerance that was missed.
fn missed(reached: &Reached, (step, time): (u64, f64)) -> Option<Finding> {
    if reached.report.met {
        return None;
    }
    let error =
        reached.report.reached.map_or("no error can be told".to_owned(), |error| format!("the error is {error:.2e}"));
    let message = format!("the tolerance {:.2e} was missed: {error}", reached.report.tolerance);
    let advice = match reached.next {
        Some((spacing, cpu_s)) => {
            format!("a spacing of {spacing:.3e} would meet it and take about {cpu_s:.1} CPU seconds")
        }
        None => "the runs so far do not tell which spacing would meet it; look at the study of the job".to_owned(),
    };
    Some(Finding { advice: Some(Cow::Owned(advice)), ..Finding::warning("accuracy.missed", message, (step, time)) })
}
