//! What came of the accuracy that a job was asked for, at the end of its run.

use crate::formats::quantity_reader::{self, RunResults};
use crate::spec::accuracy::{ChosenAccuracy, KnownLevel, Reached};
use crate::spec::quantity::Quantity;
use crate::spec::report::RunReport;
use meniscus::scene::Scene;
use meniscus::simulation::Finding;
use std::borrow::Cow;

/// What a run has reached, by its report and its series.
///
/// # Errors
/// A sentence that says what they lack.
pub fn judge(chosen: &ChosenAccuracy, report: &RunReport, series: &str, scene: &dyn Scene) -> Result<Reached, String> {
    let quantity = chosen.quantity().ok_or("the quantity of the accuracy cannot be read")?;
    let report_json = serde_json::to_value(report).map_err(|error| error.to_string())?;
    let value = quantity_reader::read(&quantity, &RunResults { report, report_json: &report_json, series })?;
    let scale = if chosen.relative { quantity_reader::scale(&quantity, report)? } else { 1.0 };
    let theory = match &quantity {
        Quantity::Error { quantity, norm, .. } => scene.order(quantity, norm),
        Quantity::Series { .. } | Quantity::Report { .. } => None,
    };
    let spacing = scene.spacing().ok_or("the spacing of the scene is not known")?;
    Ok(chosen.reached(KnownLevel { spacing, value, cpu_s: report.cost.cpu_s }, scale, theory))
}

/// The finding of a tolerance that was missed.
#[must_use]
pub fn missed(reached: &Reached, (step, time): (u64, f64)) -> Option<Finding> {
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
