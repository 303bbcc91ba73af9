//! What a level of a study has come to, from the report and the series that its run left.

use super::quantity_reader::{self, RunResults};
use crate::spec::attempt_files;
use crate::spec::quantity::Quantity;
use crate::spec::report::{Provenance, RunReport};
use crate::spec::study::MeasuredLevel;
use meniscus::scene::Scene;
use serde::Deserialize;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// The level of a run in a directory, and where its numbers come from. The number of particles and the forecast are not known there.
///
/// # Errors
/// A sentence that says what the files lack.
pub fn read(
    directory: &Path,
    scene: &dyn Scene,
    quantity: &Quantity,
    is_relative: bool,
) -> Result<(MeasuredLevel, Provenance), String> {
    let text = |name: &str| {
        fs::read_to_string(directory.join(name)).map_err(|error| format!("{name} cannot be read: {error}"))
    };
    let unreadable = |error: serde_json::Error| format!("the report cannot be read: {error}");
    let report_json: Value = serde_json::from_str(&text(attempt_files::REPORT)?).map_err(unreadable)?;
    let report = RunReport::deserialize(&report_json).map_err(unreadable)?;
    let series = text(attempt_files::SERIES)?;
    let results = RunResults { report: &report, report_json: &report_json, series: &series };
    let value = quantity_reader::read(quantity, &results)?;
    let scale = if is_relative { quantity_reader::scale(quantity, &report)? } else { 1.0 };
    let level = MeasuredLevel {
        spacing: scene.spacing().ok_or("the spacing of the scene is not known")?,
        value,
        scale,
        theory: quantity.order(scene),
        cpu_s: report.cost.cpu_s,
        forecast_cpu_s: None,
        wall_s: report.cost.wall_s,
        particles: 0,
        steps: report.cost.steps,
        health: report.health.status,
    };
    Ok((level, report.provenance))
}
