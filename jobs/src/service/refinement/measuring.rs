//! What a level has come to, from the files and the row of its job.

use crate::formats::quantity_reader::{self, RunResults};
use crate::service::store::{JobRow, Store};
use crate::spec::attempt_files::{self, attempt_directory};
use crate::spec::body::{ResolvedBody, resolved_scene};
use crate::spec::quantity::Quantity;
use crate::spec::report::RunReport;
use crate::spec::study::MeasuredLevel;
use crate::system::build;
use meniscus::scene;
use meniscus::scenes::SCENES;
use serde::Deserialize;
use serde_json::Value;
use std::fs;

/// Report and series of a job that has succeeded.
struct Files {
    report: RunReport,
    report_json: Value,
    series: String,
}

fn files(store: &Store, job: &JobRow) -> Result<Files, String> {
    let directory = attempt_directory(&store.job_directory(&job.id), job.attempt);
    let read = |name: &str| {
        fs::read_to_string(directory.join(name))
            .map_err(|error| format!("{name} of {} cannot be read: {error}", job.id))
    };
    let report_json: Value = serde_json::from_str(&read(attempt_files::REPORT)?)
        .map_err(|error| format!("the report of {} cannot be read: {error}", job.id))?;
    let report = RunReport::deserialize(&report_json)
        .map_err(|error| format!("the report of {} cannot be read: {error}", job.id))?;
    Ok(Files { report, report_json, series: read(attempt_files::SERIES)? })
}

/// What a job that has succeeded says of a quantity.
///
/// # Errors
/// A sentence that says what it lacks.
pub fn measure(store: &Store, job: &JobRow, quantity: &Quantity, is_relative: bool) -> Result<MeasuredLevel, String> {
    let Files { report, report_json, series } = files(store, job)?;
    let results = RunResults { report: &report, report_json: &report_json, series: &series };
    let value = quantity_reader::read(quantity, &results)?;
    let scale = if is_relative { quantity_reader::scale(quantity, &report)? } else { 1.0 };
    let scene = resolved_scene(&job.resolved).map_err(|error| error.to_string())?;
    let scene = scene::parse(&scene, SCENES)
        .map_err(|found| found.first().map_or_else(String::new, |violation| violation.detail.clone()))?;
    let theory = match quantity {
        Quantity::Error { quantity, norm } => scene.order(quantity, norm),
        Quantity::Series { .. } | Quantity::Report { .. } => None,
    };
    Ok(MeasuredLevel {
        spacing: scene.spacing().ok_or("the spacing of the scene is not known")?,
        value,
        scale,
        theory,
        cpu_s: report.cost.cpu_s,
        forecast_cpu_s: job.forecast.cpu_s,
        wall_s: report.cost.wall_s,
        particles: job.progress.particles,
        steps: report.cost.steps,
        health: job.health,
    })
}

/// An earlier job with the same resolved scene and output, of this build and instruction set, and what it has come to.
///
/// # Errors
/// When the store fails.
pub fn earlier(
    store: &Store,
    body: &ResolvedBody,
    scene_sha256: &str,
    quantity: &Quantity,
    is_relative: bool,
) -> Result<Option<(String, MeasuredLevel)>, crate::service::store::StoreError> {
    let is_equal = |job: &JobRow| {
        let resolved = ResolvedBody::deserialize(&job.resolved).ok();
        resolved.is_some_and(|other| other.scene == body.scene && other.options.output == body.options.output)
    };
    for job in store.jobs_of_scene(scene_sha256)?.iter().filter(|job| is_equal(job)) {
        let Ok(Files { report, .. }) = files(store, job) else { continue };
        if report.provenance.build != build::name() || report.provenance.isa != build::isa() {
            continue;
        }
        if let Ok(measured) = measure(store, job, quantity, is_relative) {
            return Ok(Some((job.id.clone(), measured)));
        }
    }
    Ok(None)
}
