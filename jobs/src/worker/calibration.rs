//! Measuring this machine: short runs that every kind of scene names, in a process of their own.

use crate::spec::attempt_files;
use crate::spec::calibration::PhaseMeasured;
use crate::spec::forecast::{ForecastRecord, measured};
use crate::spec::report::RunReport;
use crate::spec::work_precision::{PrecisionMeasured, of_reference};
use crate::worker::local_run;
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::Path;

/// How often every calibrating run is made: a machine that others use as well is judged by the median.
const ROUNDS: usize = 5;

/// Measures this machine by the short runs that every kind of scene names, in a directory that is emptied again. The rounds
/// go over all of them in turn, so that a slow moment spoils one round of a few, not all of one.
///
/// # Errors
/// A sentence that names the run.
pub fn measure_here(directory: &Path, threads: u64) -> Result<Vec<PhaseMeasured>, String> {
    let mut scenes: Vec<Value> = Vec::new();
    for kind in meniscus::scenes::SCENES {
        let named: Vec<Value> = serde_json::from_str(kind.calibration)
            .map_err(|error| format!("calibration scenes of {}: {error}", kind.kind))?;
        scenes.extend(named);
    }
    let mut rounds = Vec::new();
    for _ in 0..ROUNDS {
        let round: Result<Vec<_>, String> = scenes.iter().map(|scene| measure_run(scene, directory, threads)).collect();
        rounds.push(round?.concat());
    }
    // Only what has just been made here.
    let _ = std::fs::remove_dir_all(directory);
    Ok(medians(&rounds))
}

/// What short runs with several spacings say of errors, for every kind that names some. Of a run that fails `failed` is told, and
/// the others are made all the same.
///
/// # Errors
/// A sentence that names the kind whose scenes are not understood.
pub fn precision_here(directory: &Path, threads: u64, failed: &dyn Fn(&str)) -> Result<Vec<PrecisionMeasured>, String> {
    let mut rows = Vec::new();
    for kind in meniscus::scenes::SCENES {
        let named: Vec<Reference> = serde_json::from_str(kind.precision)
            .map_err(|error| format!("scenes of {} for the precision: {error}", kind.kind))?;
        for Reference { mut scene, axis, values } in named {
            for value in values {
                scene[&axis] = value;
                match measure_precision(&scene, directory, threads) {
                    Ok(found) => rows.extend(found),
                    Err(error) => failed(&error),
                }
            }
        }
    }
    let _ = std::fs::remove_dir_all(directory);
    Ok(rows)
}

/// A scene without a spacing, and values of its `spacing` or of its `count` of points.
#[derive(Deserialize)]
struct Reference {
    scene: Value,
    axis: String,
    values: Vec<Value>,
}

/// One scene with every choice that it leaves open.
fn measure_precision(scene: &Value, directory: &Path, threads: u64) -> Result<Vec<PrecisionMeasured>, String> {
    let plan = |scene: &Value| {
        meniscus::scene::parse(scene, meniscus::scenes::SCENES).map_err(|errors| format!("{scene}: {errors:?}"))
    };
    let mut choices: Vec<Option<(&str, Value)>> = Vec::new();
    for (pointer, values) in plan(scene)?.choices() {
        choices.extend(values.into_iter().map(|value| Some((pointer, value))));
    }
    if choices.is_empty() {
        choices.push(None);
    }
    let mut rows = Vec::new();
    for choice in &choices {
        let mut scene = scene.clone();
        if let Some((pointer, value)) = choice {
            scene[pointer.trim_start_matches('/')] = value.clone();
        }
        let (report, _) = run_report(&scene, directory, threads)?;
        let choice = choice.as_ref().map(|(pointer, value)| (*pointer, value));
        rows.extend(of_reference(plan(&scene)?.as_ref(), choice, &report));
    }
    Ok(rows)
}

fn run_report(scene: &Value, directory: &Path, threads: u64) -> Result<(RunReport, ForecastRecord), String> {
    let body = local_run::run(&json!({"scene": scene}), directory, threads, local_run::Keep::Report)
        .map_err(|cause| format!("{scene}: {cause}"))?;
    let report = std::fs::read(directory.join(attempt_files::REPORT)).map_err(|error| error.to_string())?;
    let report: RunReport = serde_json::from_slice(&report).map_err(|error| error.to_string())?;
    Ok((report, body.forecast.record()))
}

fn measure_run(scene: &Value, directory: &Path, threads: u64) -> Result<Vec<PhaseMeasured>, String> {
    let (report, forecast) = run_report(scene, directory, threads)?;
    Ok(measured(&forecast, &report.cost, threads))
}

/// Of every phase of every run the round in the middle; all rounds list the same.
fn medians(rounds: &[Vec<PhaseMeasured>]) -> Vec<PhaseMeasured> {
    let length = rounds.iter().map(Vec::len).min().unwrap_or(0);
    let pace = |one: &PhaseMeasured| one.measured.seconds / one.measured.work;
    (0..length)
        .map(|k| {
            let mut found: Vec<&PhaseMeasured> = rounds.iter().map(|round| &round[k]).collect();
            found.sort_by(|a, b| pace(a).total_cmp(&pace(b)));
            found[found.len() / 2].clone()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::calibration::Measured;

    #[test]
    fn a_slow_round_does_not_count() {
        let round = |seconds: [f64; 2]| {
            ["fits", "queries"].into_iter().zip(seconds).map(|(phase, seconds)| {
                let measured = Measured { work: 2.0, seconds };
                PhaseMeasured { family: "redistance/2".to_owned(), phase: phase.to_owned(), measured }
            })
        };
        let rounds = [[1.0, 9.0], [1.2, 3.0], [7.0, 2.0]].map(|seconds| round(seconds).collect()).to_vec();
        let found: Vec<f64> = medians(&rounds).iter().map(|one| one.measured.seconds).collect();
        assert_eq!(found, [1.2, 3.0]);
    }
}
