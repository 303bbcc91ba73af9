//! Measuring this machine: short runs that every kind of scene names, in a process of their own.

use crate::spec::attempt_files;
use crate::spec::calibration::PhaseMeasured;
use crate::spec::forecast::measured;
use crate::spec::report::RunReport;
use crate::worker::local_run;
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

fn measure_run(scene: &Value, directory: &Path, threads: u64) -> Result<Vec<PhaseMeasured>, String> {
    let body = json!({"scene": scene});
    let body = local_run::run(&body, directory, threads, local_run::Keep::Report)
        .map_err(|cause| format!("{scene}: {cause}"))?;
    let report = std::fs::read(directory.join(attempt_files::REPORT)).map_err(|error| error.to_string())?;
    let report: RunReport = serde_json::from_slice(&report).map_err(|error| error.to_string())?;
    Ok(measured(&body.forecast.record(), &report.cost, threads))
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
