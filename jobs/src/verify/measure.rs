//! From reports to figures.

use meniscus::scene::rows::{Measure, Quantity};
use serde_json::Value;

/// An error of a report; None where it has none of that name.
#[must_use]
pub fn error(report: &Value, quantity: Quantity) -> Option<f64> {
    let entries = report["errors"].as_array()?;
    let named = entries.iter().filter(|e| e["quantity"] == quantity.name && e["norm"] == quantity.norm);
    let time = |entry: &Value| entry["time"].as_f64().unwrap_or(f64::NEG_INFINITY);
    let found = match quantity.time {
        Some(wanted) => named.into_iter().find(|entry| (time(entry) - wanted).abs() < 1e-6),
        None => named.into_iter().max_by(|a, b| time(a).total_cmp(&time(b))),
    };
    found?["value"].as_f64()
}

/// The length that errors are held against: h, or where a scene has a number of points on a surface N^(−1/2), on a circle 1/N.
#[must_use]
pub fn spacing(scene: &Value) -> Option<f64> {
    let is_curve = [&scene["surface"], &scene["surface"]["type"]].iter().any(|surface| **surface == "circle");
    let apart = |count: f64| if is_curve { 1.0 / count } else { 1.0 / count.sqrt() };
    scene["spacing"].as_f64().or_else(|| scene["count"].as_f64().map(apart))
}

/// CPU seconds in phases whose names begin so; without a name in all that are not errors and references.
#[must_use]
pub fn seconds(report: &Value, prefix: &str) -> f64 {
    let phases = report["cost"]["phases"].as_object();
    let is_meant = |name: &str| if prefix.is_empty() { name != "errors" } else { name.starts_with(prefix) };
    let own = phases.into_iter().flatten().filter(|(name, _)| is_meant(name));
    own.filter_map(|(_, seconds)| seconds.as_f64()).sum()
}

/// The figure of a measure; NaN where reports do not have it.
#[must_use]
pub fn measure(measure: Measure, scenes: &[Value], reports: &[Value]) -> f64 {
    let nothing = Value::Null;
    let (first, last) = (reports.first().unwrap_or(&nothing), reports.last().unwrap_or(&nothing));
    let spacing = |scene: &Value| spacing(scene).unwrap_or(f64::NAN);
    match measure {
        Measure::Error(of) => error(last, of).unwrap_or(f64::NAN),
        Measure::WorstInSpacings(of) => {
            let ratio = |(scene, report): (&Value, &Value)| error(report, of).unwrap_or(f64::NAN) / spacing(scene);
            // A NaN must not be lost in the maximum.
            scenes.iter().zip(reports).map(ratio).fold(0.0, |worst, r| if r <= worst { worst } else { r })
        }
        Measure::Order { of, floor } => {
            let points: Vec<(f64, f64)> = scenes
                .iter()
                .zip(reports)
                .filter_map(|(scene, report)| Some((spacing(scene).ln(), error(report, of)?)))
                .filter(|(_, error)| *error > floor)
                .map(|(x, error)| (x, error.ln()))
                .collect();
            slope(&points)
        }
        Measure::Growth(of) => error(last, of).unwrap_or(f64::NAN) / error(first, of).unwrap_or(f64::NAN),
        Measure::Difference(of) => (error(last, of).unwrap_or(f64::NAN) - error(first, of).unwrap_or(f64::NAN)).abs(),
        Measure::Memory => last["cost"]["peak_memory_bytes"].as_f64().unwrap_or(f64::NAN),
        Measure::Seconds(prefix) => seconds(last, prefix),
        Measure::SecondsPerStep(prefix) => seconds(last, prefix) / last["cost"]["steps"].as_f64().unwrap_or(f64::NAN),
        Measure::SecondsShare(prefix) => seconds(last, prefix) / seconds(first, prefix),
        Measure::Rescued(name) => {
            let stability = &last["stability"];
            let count =
                stability["rescued_fits"][name].as_f64().or_else(|| stability["newton"]["rescued"][name].as_f64());
            count.unwrap_or(0.0)
        }
    }
}

/// The slope of the least-squares line; NaN for fewer than four points, of which no line says much.
fn slope(points: &[(f64, f64)]) -> f64 {
    if points.len() < 4 {
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
    use super::{Measure, Quantity, measure};
    use serde_json::{Value, json};

    const RMS: Quantity = Quantity::at_end("phi", "rms");

    fn report(error: f64) -> Value {
        json!({
            "errors": [
                {"quantity": "phi", "norm": "rms", "value": 9.0, "time": 0.5},
                {"quantity": "phi", "norm": "rms", "value": error, "time": 1.0},
            ],
            "cost": {"steps": 4, "phases": {"redistancing/query": 2.0, "redistancing/regression": 1.0, "output": 7.0}},
            "stability": {"rescued_fits": {"fits.larger_radius": 3}, "newton": {"rescued": {}}},
        })
    }

    #[test]
    fn figures_come_out_of_reports() {
        let scenes: Vec<Value> = [0.1, 0.05, 0.025, 0.0125].iter().map(|h| json!({"spacing": h})).collect();
        let reports: Vec<Value> = [0.1, 0.05, 0.025, 0.0125].iter().map(|h: &f64| report(h.powi(3))).collect();
        let of = |m| measure(m, &scenes, &reports);
        assert!((of(Measure::Order { of: RMS, floor: 0.0 }) - 3.0).abs() < 1e-12);
        assert!(of(Measure::Order { of: RMS, floor: 1e-5 }).is_nan(), "three points are no line");
        assert!((of(Measure::Error(RMS)) - 0.0125_f64.powi(3)).abs() < 1e-18);
        assert!((of(Measure::Error(Quantity::at("phi", "rms", 0.5))) - 9.0).abs() < 1e-15);
        assert!((of(Measure::Growth(RMS)) - 1.0 / 512.0).abs() < 1e-12);
        assert!((of(Measure::SecondsPerStep("redistancing")) - 0.75).abs() < 1e-12);
        assert!((of(Measure::SecondsShare("redistancing")) - 1.0).abs() < 1e-12);
        assert!((of(Measure::Rescued("fits.larger_radius")) - 3.0).abs() < 1e-12);
        assert!(of(Measure::Error(Quantity::at_end("area", "relative"))).is_nan());
    }
}
