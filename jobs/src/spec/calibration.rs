//! What a unit of work takes, by phase: kept per build and machine, begun by a few short runs, refined by every job
//! that finishes.

use crate::spec::forecast::TimeForecast;
use crate::system::process;
use crate::worker::local_run;
use meniscus::scene::PhaseWork;
use meniscus::scene::work::Course;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;

/// Work and the CPU seconds that it took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Units.
    pub work: f64,
    /// CPU seconds.
    pub seconds: f64,
}

/// What was measured of one phase of one family of runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PhaseMeasured {
    /// Kind, dimension and method.
    pub family: String,
    /// Phase.
    pub phase: String,
    /// How much.
    pub measured: Measured,
}

/// Everything that was measured on this machine with this build.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Calibration {
    known: BTreeMap<(String, String), Measured>,
}

/// The weight that earlier runs keep when a new one comes.
pub const MEMORY: f64 = 0.7;
/// The phase that relates the clock to CPU seconds, for a number of threads.
fn wall(threads: u64) -> String {
    format!("wall@{threads}")
}

/// The first two parts of a family's name.
fn kind_and_dimension(family: &str) -> &str {
    family.match_indices('/').nth(1).map_or(family, |(end, _)| &family[..end])
}

impl Calibration {
    /// From what was kept.
    #[must_use]
    pub fn new(kept: impl IntoIterator<Item = PhaseMeasured>) -> Self {
        Self { known: kept.into_iter().map(|one| ((one.family, one.phase), one.measured)).collect() }
    }

    /// Whether anything is known.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.known.is_empty()
    }

    /// Seconds of a unit: of this family, else of the same kind in the same dimension, else over all.
    fn seconds_per_unit(&self, family: &str, phase: &str) -> Option<f64> {
        let ratio = |m: Measured| (m.work > 0.0).then_some(m.seconds / m.work);
        if let Some(found) = self.known.get(&(family.to_owned(), phase.to_owned())).and_then(|m| ratio(*m)) {
            return Some(found);
        }
        let over = |is_alike: &dyn Fn(&str) -> bool| {
            let alike = self.known.iter().filter(|((other, name), _)| name == phase && is_alike(other));
            let add = |a: Measured, b: &Measured| Measured { work: a.work + b.work, seconds: a.seconds + b.seconds };
            ratio(alike.map(|(_, m)| m).fold(Measured::default(), add))
        };
        // The same kind in the same dimension by another method is nearer than anything else.
        let nearest = kind_and_dimension(family);
        over(&|other| kind_and_dimension(other) == nearest).or_else(|| over(&|_| true))
    }

    /// The time of a run; None while a phase that it has was never measured.
    #[must_use]
    pub fn time(&self, family: &str, work: &[PhaseWork], threads: u64) -> Option<TimeForecast> {
        let mut forecast = TimeForecast::default();
        for phase in work.iter().filter(|phase| phase.units > 0.0) {
            let seconds = phase.units * self.seconds_per_unit(family, phase.phase)?;
            forecast.cpu_s += seconds;
            if phase.course == Course::Moments {
                *forecast.moments.entry(phase.phase.to_owned()).or_insert(0.0) += seconds;
            }
        }
        let clock = self.seconds_per_unit(family, &wall(threads)).unwrap_or(1.0 / threads as f64);
        forecast.wall_s = forecast.cpu_s * clock;
        let is_known = |is_alike: &dyn Fn(&str) -> bool| self.known.keys().any(|(known, _)| is_alike(known));
        let alike = kind_and_dimension(family);
        let of = if is_known(&|known| known == family) {
            family
        } else if is_known(&|known| kind_and_dimension(known) == alike) {
            alike
        } else {
            "other"
        };
        forecast.basis = format!("measured {of} runs of this build on this machine, by phase");
        Some(forecast)
    }
}

/// What a finished run tells: its work as forecast, and the phases of its report.
#[must_use]
pub fn measured(estimate: &Value, cost: &Value, threads: u64) -> Vec<PhaseMeasured> {
    let family = estimate["family"].as_str().unwrap_or_default().to_owned();
    let Some(work) = estimate["work"].as_object() else { return Vec::new() };
    let booked = cost["phases"].as_object();
    let seconds = |phase: &str| booked.and_then(|b| b.get(phase)).and_then(Value::as_f64).unwrap_or(0.0);
    let cpu_s = cost["cpu_s"].as_f64().unwrap_or(0.0);
    let rest = cpu_s - booked.into_iter().flatten().filter_map(|(_, v)| v.as_f64()).sum::<f64>();
    let mut found: Vec<PhaseMeasured> = work
        .iter()
        .filter_map(|(phase, units)| Some((phase, units.as_f64().filter(|units| *units > 0.0)?)))
        .map(|(phase, work)| {
            let seconds = if phase == meniscus::scenes::work_estimate::REST { rest.max(0.0) } else { seconds(phase) };
            PhaseMeasured { family: family.clone(), phase: phase.clone(), measured: Measured { work, seconds } }
        })
        .collect();
    if let Some(wall_s) = cost["wall_s"].as_f64().filter(|_| cpu_s > 0.0) {
        let measured = Measured { work: cpu_s, seconds: wall_s };
        found.push(PhaseMeasured { family, phase: wall(threads), measured });
    }
    found
}

/// The name of this machine for calibration: processor and number of cores.
#[must_use]
pub fn machine() -> &'static str {
    static NAME: OnceLock<String> = OnceLock::new();
    NAME.get_or_init(|| {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        format!("{} x {cores}", process::cpu_name().unwrap_or_else(|| "unknown".to_owned()))
    })
}

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
    let report = std::fs::read(directory.join("report.json")).map_err(|error| error.to_string())?;
    let report: Value = serde_json::from_slice(&report).map_err(|error| error.to_string())?;
    Ok(measured(&body.forecast.to_json(), &report["cost"], threads))
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
