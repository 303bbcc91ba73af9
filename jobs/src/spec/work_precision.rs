//! Work and precision: what error a run had with a spacing, and what it cost. Kept by build, begun by short runs of
//! `meniscus calibrate`, refined by every finished job whose error is known.

use crate::convergence::{Cost, Level};
use crate::spec::report::RunReport;
use crate::system::digest;
use meniscus::scene::Scene;
use meniscus::spec::{Json, Object};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// What one run says of one error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PrecisionMeasured {
    /// Digest of the scene without its spacing: see [`problem_of`].
    pub problem: String,
    /// Quantity of the error.
    pub quantity: String,
    /// Norm of the error.
    pub norm: String,
    /// Resolved spacing.
    pub spacing: f64,
    /// The error, at its latest time.
    pub error: f64,
    /// CPU seconds of the run.
    pub cpu_s: f64,
}

/// Digest of a scene as sent, without the spacing or the count of its points: runs with the same one differ in nothing else.
#[must_use]
pub fn problem_of(scene: &Json) -> Option<String> {
    let mut scene = scene.as_object()?.clone();
    for name in ["spacing", "count"] {
        scene.shift_remove(name);
    }
    Some(digest::of_bytes(sorted(&Json::Object(scene)).to_string().as_bytes()))
}

/// The same JSON with names in the order of the alphabet: the order in which a client writes them has no meaning.
fn sorted(value: &Json) -> Json {
    match value {
        Value::Object(map) => {
            let names: BTreeMap<&String, Json> = map.iter().map(|(name, value)| (name, sorted(value))).collect();
            Value::Object(names.into_iter().map(|(name, value)| (name.clone(), value)).collect::<Object>())
        }
        Value::Array(list) => list.iter().map(sorted).collect(),
        other => other.clone(),
    }
}

/// What a finished run says: each error at its latest time.
#[must_use]
pub fn of_report(problem: &str, spacing: f64, report: &RunReport) -> Vec<PrecisionMeasured> {
    let mut latest: BTreeMap<(&str, &str), f64> = BTreeMap::new();
    for entry in report.errors.iter().filter(|entry| entry.value > 0.0 && entry.value.is_finite()) {
        latest.insert((&entry.quantity, &entry.norm), entry.value);
    }
    let row = |((quantity, norm), error): ((&str, &str), f64)| PrecisionMeasured {
        problem: problem.to_owned(),
        quantity: quantity.to_owned(),
        norm: norm.to_owned(),
        spacing,
        error,
        cpu_s: report.cost.cpu_s,
    };
    latest.into_iter().map(row).collect()
}

/// How names of short runs begin; those of other runs are digests.
pub const REFERENCE: &str = "reference ";

/// Under which name short runs of `meniscus calibrate` keep what they say of scenes like this one with a choice of its own.
#[must_use]
pub fn reference_of(scene: &dyn Scene, choice: Option<(&str, &Json)>) -> String {
    let choice = choice.map_or_else(String::new, |(pointer, value)| format!(" {pointer} = {}", sorted(value)));
    format!("{REFERENCE}{}{choice}", scene.family())
}

/// What an error of a quantity is divided by when scenes of different sizes are compared.
#[must_use]
pub fn error_scale(scene: &dyn Scene, quantity: &str, size: f64) -> f64 {
    let field = scene.fields().into_iter().find(|field| field.name == quantity);
    match field.map(|field| field.unit) {
        Some("length") => size,
        Some("1/length") => size.recip(),
        _ => 1.0,
    }
}

/// What a short run says of scenes of any size: spacing and errors by the size.
#[must_use]
pub fn of_reference(scene: &dyn Scene, choice: Option<(&str, &Json)>, report: &RunReport) -> Vec<PrecisionMeasured> {
    let Some((size, spacing)) = scene.size().zip(scene.spacing()) else { return Vec::new() };
    let mut rows = of_report(&reference_of(scene, choice), spacing / size, report);
    for row in &mut rows {
        row.error /= error_scale(scene, &row.quantity, size);
    }
    rows
}

/// CPU seconds of a run at a spacing, by levels that are known, the coarsest first: between two levels by the power through them.
#[must_use]
pub fn cost_at(levels: &[Level], spacing: f64) -> Option<f64> {
    let finer = levels.iter().position(|level| level.spacing <= spacing);
    match finer {
        Some(k) => Cost::new(&levels[..=k]).map(|cost| cost.at(spacing)).or(Some(levels[k].cpu_s)),
        None => Cost::new(levels).map(|cost| cost.at(spacing)),
    }
}

#[cfg(test)]
mod tests {
    use super::{cost_at, problem_of};
    use crate::convergence::Level;
    use serde_json::json;

    #[test]
    fn a_problem_is_a_scene_without_its_spacing_however_it_is_written() {
        let one = problem_of(&json!({"kind": "redistance", "spacing": 0.1, "shape": {"type": "circle", "radius": 1}}));
        let same = problem_of(&json!({"shape": {"radius": 1, "type": "circle"}, "kind": "redistance", "spacing": 0.2}));
        let other = problem_of(&json!({"kind": "redistance", "shape": {"type": "circle", "radius": 2}}));
        assert!(one.is_some() && one == same && one != other);
        assert_eq!(problem_of(&json!(3)), None);
    }

    #[test]
    fn the_cost_between_two_levels_lies_between_theirs() {
        let levels = [0.2, 0.1, 0.05].map(|spacing: f64| Level { spacing, value: 0.0, cpu_s: spacing.powi(-2) });
        for spacing in [0.15_f64, 0.07, 0.04] {
            assert!((cost_at(&levels, spacing).unwrap() * spacing.powi(2) - 1.0).abs() < 1e-9);
        }
        assert!((cost_at(&levels, 0.5).unwrap() - levels[0].cpu_s).abs() < 1e-12, "no less than the coarsest");
        assert_eq!(cost_at(&[], 0.1), None);
    }
}
