//! From reports to the values that targets compare.

use crate::spec::report::RunReport;
use serde::Deserialize;
use serde_json::Value;

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
            Self::Ratio(_) | Self::Difference(_) | Self::SecondsRatio { .. } => 2,
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

/// The length to which errors are compared: the spacing h, or for N points N^(−1/2) on a surface and 1/N on a circle.
#[must_use]
pub fn spacing(scene: &Value) -> Option<f64> {
    let size = SceneSize::deserialize(scene).ok()?;
    let is_curve = size.surface.is_some_and(|surface| surface.name() == "circle");
    let apart = |count: f64| if is_curve { 1.0 / count } else { 1.0 / count.sqrt() };
    size.spacing.or_else(|| size.count.map(apart))
}

/// What a scene says of its size.
#[derive(Deserialize)]
struct SceneSize {
    spacing: Option<f64>,
    count: Option<f64>,
    surface: Option<SurfaceName>,
}

/// A surface, by its bare name or with parameters.
#[derive(Deserialize)]
#[serde(untagged)]
enum SurfaceName {
    Bare(String),
    Chosen {
        #[serde(rename = "type")]
        name: String,
    },
}

impl SurfaceName {
    fn name(&self) -> &str {
        match self {
            Self::Bare(name) | Self::Chosen { name } => name,
        }
    }
}

/// CPU seconds in cost spans whose names begin with `prefix`; with an empty one in all but the computation of errors.
#[must_use]
pub fn seconds(report: &RunReport, prefix: &str) -> f64 {
    let is_meant = |name: &str| if prefix.is_empty() { name != "errors" } else { name.starts_with(prefix) };
    report.cost.phases.iter().filter(|(name, _)| is_meant(name)).map(|(_, seconds)| seconds).sum()
}

/// The value of a measure over runs (scenes and their reports); NaN where reports do not have it.
#[must_use]
pub fn evaluate(measure: &Measure, scenes: &[&Value], reports: &[&RunReport]) -> f64 {
    let (Some(first), Some(last)) = (reports.first(), reports.last()) else { return f64::NAN };
    let spacing = |scene: &Value| spacing(scene).unwrap_or(f64::NAN);
    let error_of = |report: &RunReport, of: &Quantity| error(report, of).unwrap_or(f64::NAN);
    match measure {
        Measure::Error(of) => error_of(last, of),
        Measure::LargestErrorInSpacings(of) => {
            let ratio = |(scene, report): (&&Value, &&RunReport)| error_of(report, of) / spacing(scene);
            // A NaN must not be lost in the maximum.
            scenes.iter().zip(reports).map(ratio).fold(0.0, |worst, r| if r <= worst { worst } else { r })
        }
        Measure::Order { quantity, norm, time, floor } => {
            let of = Quantity { quantity: quantity.clone(), norm: norm.clone(), time: *time };
            let points: Vec<(f64, f64)> = scenes
                .iter()
                .zip(reports)
                .filter_map(|(scene, report)| Some((spacing(scene).ln(), error(report, &of)?)))
                .filter(|(_, error)| error > floor)
                .map(|(x, error)| (x, error.ln()))
                .collect();
            slope(&points)
        }
        Measure::Ratio(of) => error_of(last, of) / error_of(first, of),
        Measure::Difference(of) => (error_of(last, of) - error_of(first, of)).abs(),
        Measure::Memory {} => last.cost.peak_memory_bytes as f64,
        Measure::Seconds { spans } => seconds(last, spans),
        Measure::SecondsPerStep { spans } => seconds(last, spans) / last.cost.steps as f64,
        Measure::SecondsRatio { spans } => seconds(last, spans) / seconds(first, spans),
        Measure::Diagnostic { name } => last.diagnostic(name).unwrap_or(0.0),
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
    use super::{Measure, RunReport, evaluate};
    use serde_json::{Value, json};

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
    fn values_come_out_of_reports() {
        let spacings = [0.1, 0.05, 0.025, 0.0125_f64];
        let scenes: Vec<Value> = spacings.iter().map(|h| json!({"spacing": h})).collect();
        let reports: Vec<RunReport> = spacings.iter().map(|h| report(h.powi(3))).collect();
        let (scenes, reports): (Vec<&Value>, Vec<&RunReport>) = (scenes.iter().collect(), reports.iter().collect());
        let of = |measure: Value| {
            let measure: Measure = serde_json::from_value(measure).unwrap();
            evaluate(&measure, &scenes, &reports)
        };
        let rms = |kind: &str| json!({"type": kind, "quantity": "phi", "norm": "rms"});
        let order = |floor: f64| of(json!({"type": "order", "quantity": "phi", "norm": "rms", "floor": floor}));
        assert!((order(0.0) - 3.0).abs() < 1e-12);
        assert!(order(1e-5).is_nan(), "three points are no line");
        assert!((of(rms("error")) - 0.0125_f64.powi(3)).abs() < 1e-18);
        assert!((of(json!({"type": "error", "quantity": "phi", "norm": "rms", "time": 0.5})) - 9.0).abs() < 1e-15);
        assert!((of(rms("ratio")) - 1.0 / 512.0).abs() < 1e-12);
        assert!((of(rms("difference")) - (1e-3 - 0.0125_f64.powi(3))).abs() < 1e-15);
        assert!((of(rms("largest_error_in_spacings")) - 0.01).abs() < 1e-12);
        assert!((of(json!({"type": "seconds", "spans": "redistancing"})) - 3.0).abs() < 1e-12);
        assert!((of(json!({"type": "seconds_per_step", "spans": "redistancing"})) - 0.75).abs() < 1e-12);
        assert!((of(json!({"type": "seconds_ratio", "spans": "redistancing"})) - 1.0).abs() < 1e-12);
        assert!((of(json!({"type": "diagnostic", "name": "fits.larger_radius"})) - 3.0).abs() < 1e-12);
        assert!(of(json!({"type": "error", "quantity": "area", "norm": "relative"})).is_nan());
        assert!((of(json!({"type": "memory"})) - 1024.0).abs() < 1e-12);
    }
}
