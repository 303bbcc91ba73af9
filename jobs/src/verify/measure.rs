//! From reports to the values that targets compare.

use crate::spec::body::{self, Allowance, NoSources};
use crate::spec::report::RunReport;
use serde::Deserialize;
use serde_json::Value;

/// A finished run as measures read it.
#[derive(Debug, Clone)]
pub struct FinishedRun {
    /// Distance of neighboring particles or points, to which errors are compared.
    pub spacing: Option<f64>,
    /// Its report.
    pub report: RunReport,
}

impl FinishedRun {
    /// From the job body of a run and its report.
    ///
    /// # Errors
    /// A sentence when the body is not valid.
    pub fn new(body: &Value, report: RunReport) -> Result<Self, String> {
        // It has run: its limits are no question any more.
        let allowance = Allowance { threads: 1, memory_bytes: 1 << 50, local_files: true };
        let parsed = body::parse(body, allowance, &NoSources).map_err(|error| {
            let violations = error.violations();
            violations.iter().map(|v| format!("{}: {}", v.pointer, v.detail)).collect::<Vec<_>>().join("; ")
        })?;
        Ok(Self { spacing: parsed.scene.spacing(), report })
    }
}

/// An error as reports list it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quantity {
    /// `phi`, `closest_point`, …
    pub quantity: String,
    /// `rms`, `max`, `relative`, …
    pub norm: String,
    /// Scene time; the last one reported when not given.
    pub time: Option<f64>,
}

/// How a value comes out of the reports of runs. "First" and "last" are those of the target's list of runs.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Measure {
    /// The error of the last run.
    Error(Quantity),
    /// The largest error of all runs, each in multiples of its spacing.
    LargestErrorInSpacings(Quantity),
    /// The slope of the least-squares line through the logarithms of error and spacing.
    Order {
        /// Name of the error.
        quantity: String,
        /// Norm of the error.
        norm: String,
        /// Scene time; the last one reported when not given.
        time: Option<f64>,
        /// Errors below are round-off and left out.
        floor: f64,
        /// The right value, where the report has the value itself and not its error.
        reference: Option<f64>,
    },
    /// The error of the last run divided by that of the first.
    Ratio(Quantity),
    /// The absolute difference of the errors of the last run and the first.
    Difference(Quantity),
    /// Largest resident memory of the last run, bytes.
    Memory {},
    /// CPU seconds of the last run in cost spans whose names begin with `spans`, divided by its steps.
    SecondsPerStep {
        /// Beginning of the spans' names; empty for all but the computation of errors.
        spans: String,
    },
    /// CPU seconds of the last run in such spans.
    Seconds {
        /// Beginning of the spans' names; empty for all but the computation of errors.
        spans: String,
    },
    /// CPU seconds of the last run in such spans divided by those of the first.
    SecondsRatio {
        /// Beginning of the spans' names; empty for all but the computation of errors.
        spans: String,
    },
    /// CPU seconds a step of the last run in such spans divided by those of the first.
    SecondsPerStepRatio {
        /// Beginning of the spans' names; empty for all but the computation of errors.
        spans: String,
    },
    /// A count of the last run's diagnostics; zero when the report does not list it.
    Diagnostic {
        /// Name of the count, such as `fits.larger_radius`.
        name: String,
    },
}

impl Measure {
    /// The fewest runs that it needs.
    #[must_use]
    pub fn least_runs(&self) -> usize {
        match self {
            Self::Order { .. } => LEAST_POINTS,
            Self::Ratio(_) | Self::Difference(_) | Self::SecondsRatio { .. } | Self::SecondsPerStepRatio { .. } => 2,
            Self::Error(_)
            | Self::LargestErrorInSpacings(_)
            | Self::Memory {}
            | Self::SecondsPerStep { .. }
            | Self::Seconds { .. }
            | Self::Diagnostic { .. } => 1,
        }
    }
}

/// An error of a report; `None` where it has none of that name, norm and time.
#[must_use]
pub fn error(report: &RunReport, of: &Quantity) -> Option<f64> {
    let found = report.error(&of.quantity, &of.norm, of.time).map(|entry| entry.value);
    found.filter(|value| value.is_finite())
}

/// CPU seconds in cost spans whose names begin with `prefix`; with an empty one in all but the computation of errors.
#[must_use]
pub fn seconds(report: &RunReport, prefix: &str) -> f64 {
    let is_meant = |name: &str| if prefix.is_empty() { name != "errors" } else { name.starts_with(prefix) };
    report.cost.phases.iter().filter(|(name, _)| is_meant(name)).map(|(_, seconds)| seconds).sum()
}

/// CPU seconds a step in such spans.
fn seconds_a_step(report: &RunReport, prefix: &str) -> f64 {
    seconds(report, prefix) / report.cost.steps as f64
}

/// The value of a measure over runs; NaN where their reports do not have it.
#[must_use]
pub fn evaluate(measure: &Measure, runs: &[FinishedRun]) -> f64 {
    let (Some(first), Some(last)) = (runs.first(), runs.last()) else { return f64::NAN };
    let (first, last) = (&first.report, &last.report);
    let spacing = |run: &FinishedRun| run.spacing.unwrap_or(f64::NAN);
    let error_of = |report: &RunReport, of: &Quantity| error(report, of).unwrap_or(f64::NAN);
    match measure {
        Measure::Error(of) => error_of(last, of),
        Measure::LargestErrorInSpacings(of) => {
            let ratio = |run: &FinishedRun| error_of(&run.report, of) / spacing(run);
            // A NaN must not be lost in the maximum.
            runs.iter().map(ratio).fold(0.0, |worst, r| if r <= worst { worst } else { r })
        }
        Measure::Order { quantity, norm, time, floor, reference } => {
            let of = Quantity { quantity: quantity.clone(), norm: norm.clone(), time: *time };
            let points: Vec<(f64, f64)> = runs
                .iter()
                .filter_map(|run| Some((spacing(run).ln(), error(&run.report, &of)?)))
                .map(|(x, value)| (x, reference.map_or(value, |right| (value - right).abs())))
                .filter(|(_, error)| error > floor)
                .map(|(x, error)| (x, error.ln()))
                .collect();
            slope(&points)
        }
        Measure::Ratio(of) => error_of(last, of) / error_of(first, of),
        Measure::Difference(of) => (error_of(last, of) - error_of(first, of)).abs(),
        Measure::Memory {} => last.cost.peak_memory_bytes as f64,
        Measure::Seconds { spans } => seconds(last, spans),
        Measure::SecondsPerStep { spans } => seconds_a_step(last, spans),
        Measure::SecondsPerStepRatio { spans } => seconds_a_step(last, spans) / seconds_a_step(first, spans),
        Measure::SecondsRatio { spans } => seconds(last, spans) / seconds(first, spans),
        Measure::Diagnostic { name } => last.diagnostic(name).unwrap_or(f64::NAN),
    }
}

/// A line through fewer points says little.
const LEAST_POINTS: usize = 4;

/// The slope of the least-squares line; NaN for fewer than four points.
fn slope(points: &[(f64, f64)]) -> f64 {
    if points.len() < LEAST_POINTS {
        return f64::NAN;
    }
    let n = points.len() as f64;
    let mean = |pick: fn(&(f64, f64)) -> f64| points.iter().map(pick).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let product: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    product / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::{FinishedRun, Measure, RunReport, evaluate};
    use serde_json::{Value, json};
    use std::f64::consts::PI;

    fn report(error: f64) -> RunReport {
        let report = json!({
            "errors": [
                {"quantity": "phi", "norm": "rms", "value": 9.0, "time": 0.5, "reference": "exact"},
                {"quantity": "phi", "norm": "rms", "value": error, "time": 1.0, "reference": "exact"},
            ],
            "cost": {"wall_s": 10.0, "cpu_s": 10.0, "steps": 4, "particle_steps_per_s": 1.0, "peak_memory_bytes": 1024, "phases": {"redistancing/query": 2.0, "redistancing/regression": 1.0, "output": 7.0}},
            "health": {}, "method": {},
            "diagnostics": [{"name": "fits.larger_radius", "value": 3, "unit": "", "doc": "Fits that had to grow."}],
            "provenance": {"build": "", "cpu": null, "isa": "", "threads": 1, "scene_sha256": ""},
        });
        serde_json::from_value(report).unwrap()
    }

    #[test]
    fn the_spacing_of_a_run_is_that_of_its_scene() {
        let finished = |scene: Value| FinishedRun::new(&json!({"scene": scene}), report(0.0));
        let spacing = |scene: Value| finished(scene).unwrap().spacing.unwrap();
        assert!((spacing(json!({"kind": "redistance", "spacing": 0.125})) - 0.125).abs() < 1e-15);
        // The side of the square that a point has for itself on a sphere, the arc on a circle.
        let points = |surface: &str| spacing(json!({"kind": "surface_pde", "surface": surface, "count": 400}));
        assert!((points("sphere") - (4.0 * PI / 400.0).sqrt()).abs() < 1e-12);
        let circle = json!({"kind": "surface_pde", "surface": "circle", "count": 400, "method": {"type": "surface_dcpse", "form": "copies"}});
        assert!((spacing(circle) - 2.0 * PI / 400.0).abs() < 1e-12);
        assert!(finished(json!({"kind": "redistance", "spacin": 1})).is_err());
    }

    #[test]
    fn values_come_out_of_reports() {
        let spacings = [0.1, 0.05, 0.025, 0.0125_f64];
        let run = |h: &f64| FinishedRun { spacing: Some(*h), report: report(h.powi(3)) };
        let runs: Vec<FinishedRun> = spacings.iter().map(run).collect();
        let of = |measure: Value| {
            let measure: Measure = serde_json::from_value(measure).unwrap();
            evaluate(&measure, &runs)
        };
        let rms = |kind: &str| json!({"type": kind, "quantity": "phi", "norm": "rms"});
        let order = |floor: f64| of(json!({"type": "order", "quantity": "phi", "norm": "rms", "floor": floor}));
        assert!((order(0.0) - 3.0).abs() < 1e-12);
        assert!(order(1e-5).is_nan(), "three points are no line");
        let values: Vec<FinishedRun> =
            spacings.iter().map(|h| FinishedRun { spacing: Some(*h), report: report(2.0 - h.powi(2)) }).collect();
        let about_two = json!({"type": "order", "quantity": "phi", "norm": "rms", "floor": 0, "reference": 2});
        let about_two: Measure = serde_json::from_value(about_two).unwrap();
        assert!((evaluate(&about_two, &values) - 2.0).abs() < 1e-9, "values that come close to 2 from below");
        assert!((of(rms("error")) - 0.0125_f64.powi(3)).abs() < 1e-18);
        assert!((of(json!({"type": "error", "quantity": "phi", "norm": "rms", "time": 0.5})) - 9.0).abs() < 1e-15);
        assert!((of(rms("ratio")) - 1.0 / 512.0).abs() < 1e-12);
        assert!((of(rms("difference")) - (1e-3 - 0.0125_f64.powi(3))).abs() < 1e-15);
        assert!((of(rms("largest_error_in_spacings")) - 0.01).abs() < 1e-12);
        assert!((of(json!({"type": "seconds", "spans": "redistancing"})) - 3.0).abs() < 1e-12);
        assert!((of(json!({"type": "seconds_per_step", "spans": "redistancing"})) - 0.75).abs() < 1e-12);
        assert!((of(json!({"type": "seconds_ratio", "spans": "redistancing"})) - 1.0).abs() < 1e-12);
        assert!((of(json!({"type": "seconds_per_step_ratio", "spans": "redistancing"})) - 1.0).abs() < 1e-12);
        assert!((of(json!({"type": "diagnostic", "name": "fits.larger_radius"})) - 3.0).abs() < 1e-12);
        assert!(of(json!({"type": "error", "quantity": "area", "norm": "relative"})).is_nan());
        assert!((of(json!({"type": "memory"})) - 1024.0).abs() < 1e-12);
    }
}
