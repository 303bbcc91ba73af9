//! What a level has come to, from the files and the row of its job.

use crate::formats::measured_level;
use crate::service::store::{JobRow, Store, StoreError};
use crate::spec::attempt_files::attempt_directory;
use crate::spec::body::{ResolvedBody, resolved_scene};
use crate::spec::quantity::Quantity;
use crate::spec::report::Provenance;
use crate::spec::study::MeasuredLevel;
use crate::system::build;
use meniscus::scene;
use meniscus::scenes::SCENES;
use serde::Deserialize;

/// What a job that has succeeded says of a quantity, and where its numbers come from.
///
/// # Errors
/// A sentence that says what it lacks.
pub fn measure(
    store: &Store,
    job: &JobRow,
    quantity: &Quantity,
    is_relative: bool,
) -> Result<(MeasuredLevel, Provenance), String> {
    let scene = resolved_scene(&job.resolved).map_err(|error| error.to_string())?;
    let scene = scene::parse(&scene, SCENES)
        .map_err(|found| found.first().map_or_else(String::new, |violation| violation.detail.clone()))?;
    let directory = attempt_directory(&store.job_directory(&job.id), job.attempt);
    let (level, provenance) = measured_level::read(&directory, scene.as_ref(), quantity, is_relative)?;
    let (particles, forecast_cpu_s) = (job.progress.particles, job.forecast.cpu_s);
    Ok((MeasuredLevel { particles, forecast_cpu_s, ..level }, provenance))
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
) -> Result<Option<(String, MeasuredLevel)>, StoreError> {
    let is_equal = |job: &JobRow| {
        let resolved = ResolvedBody::deserialize(&job.resolved).ok();
        resolved.is_some_and(|other| other.scene == body.scene && other.options.output == body.options.output)
    };
    let jobs = store.jobs_of_scene(scene_sha256)?;
    let found = jobs.iter().filter(|job| is_equal(job)).find_map(|job| {
        let (measured, provenance) = measure(store, job, quantity, is_relative).ok()?;
        let is_ours = provenance.build == build::name() && provenance.isa == build::isa();
        is_ours.then(|| (job.id.clone(), measured))
    });
    Ok(found)
}
