//! `accuracy` in a job: an error that is asked for instead of a spacing.

use crate::convergence::{Level, Subject, Target, assess};
use crate::spec::quantity::{Quantity, QuantitySpec};
use crate::spec::study::MeasuredLevel;
use meniscus::scene::Scene;
use meniscus::scenes::find;
use meniscus::spec::{Interval, Json, Parameter, Violation};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Tolerances: below them doubles do not tell an error from round-off.
const TOLERANCES: Interval = Interval::at_least(1e-15);

meniscus::group! {
    /// An error that is asked for; the service chooses the spacing.
    pub struct AccuracySpec {
        /// what is to be known
        quantity: QuantitySpec;
        /// how well: bound of the error, or of the grid convergence index of a value
        tolerance: f64, in TOLERANCES;
        /// whether the tolerance is a share of the quantity
        relative: bool = false;
    }
}

/// An accuracy that a body asks for, before the spacing is chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// As sent.
    pub spec: AccuracySpec,
    /// JSON pointer in the scene to the field that is chosen: `/spacing` or `/count`.
    pub axis: &'static str,
}

impl Wanted {
    /// The accuracy that a scene is asked for.
    pub fn new(
        spec: AccuracySpec,
        given: Option<&Json>,
        scene: &dyn Scene,
        errors: &mut Vec<Violation>,
    ) -> Option<Self> {
        let kind = find(scene.kind())?;
        let names: Vec<&str> = (kind.declarations)().iter().map(|field| field.name).collect();
        let axis = [("spacing", "/spacing"), ("count", "/count")].into_iter().find(|(name, _)| names.contains(name));
        let Some((name, axis)) = axis.filter(|_| scene.spacing().is_some()) else {
            let detail = "the spacing of this scene is not the service's to choose: its points are given";
            errors.push(Violation::new("/accuracy", "conflict", detail, Value::Null, Value::Null));
            return None;
        };
        if let Some(value) = given.and_then(Json::as_object).and_then(|scene| scene.get(name)) {
            let detail = format!("accuracy lets the service choose {name}; give one of them");
            errors.push(Violation::new(format!("/scene{axis}"), "conflict", detail, value.clone(), Value::Null));
        }
        let quantity = spec.quantity.resolve(Some(kind), "/accuracy/quantity", errors);
        errors.extend(quantity.and_then(|quantity| quantity.check_relative(spec.relative, "/accuracy/relative")));
        Some(Self { spec, axis })
    }

    /// The sweep of the study that finds the spacing, from a first value of the axis.
    #[must_use]
    pub fn sweep(&self, from: f64, alternatives: &[(&str, Vec<Json>)]) -> Value {
        let lists: serde_json::Map<String, Value> =
            alternatives.iter().map(|(pointer, values)| (format!("/scene{pointer}"), json!(values))).collect();
        let mut sweep = json!({
            "mode": "refine", "axis": format!("/scene{}", self.axis), "from": from, "ratio": RATIO,
            "levels": {"least": LEAST_LEVELS, "most": MOST_LEVELS}, "quantity": self.spec.quantity.as_given(),
            "until": {"tolerance": self.spec.tolerance, "relative": self.spec.relative},
        });
        if let (false, Some(object)) = (lists.is_empty(), sweep.as_object_mut()) {
            object.insert("alternatives".to_owned(), Value::Object(lists));
        }
        sweep
    }
}

/// Ratio of two levels of the study.
const RATIO: f64 = 1.4;
/// Levels of the study at least, where short runs do not tell the spacing before.
const LEAST_LEVELS: u64 = 3;
/// Levels of the study at most.
const MOST_LEVELS: u64 = 10;

/// The accuracy of a resolved body: what was asked for, and what the choice of the spacing rests on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChosenAccuracy {
    /// The quantity as sent.
    pub quantity: Value,
    /// The tolerance.
    pub tolerance: f64,
    /// Whether it is a share of the quantity.
    pub relative: bool,
    /// Predicted error.
    pub predicted: f64,
    /// Measurements on which the prediction rests.
    pub basis: String,
    /// Levels on which the prediction rests, the coarsest first: those that were run, and short runs of other scenes as they would
    /// be in this one.
    pub levels: Vec<KnownLevel>,
}

/// A level that is known before the run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct KnownLevel {
    /// Spacing.
    pub spacing: f64,
    /// The quantity.
    pub value: f64,
    /// CPU seconds.
    pub cpu_s: f64,
}

/// What came of an accuracy, as reports have it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AccuracyReport {
    /// The quantity as sent.
    pub quantity: Value,
    /// The tolerance.
    pub tolerance: f64,
    /// Predicted error, in the measure of the tolerance.
    pub predicted: f64,
    /// Error that was reached, known or estimated; null where it cannot be told.
    pub reached: Option<f64>,
    /// Whether the tolerance is met.
    pub met: bool,
}

/// The report of an accuracy, with the spacing and the CPU seconds that would meet a tolerance that was missed.
#[derive(Debug, Clone, PartialEq)]
pub struct Reached {
    /// The report.
    pub report: AccuracyReport,
    /// Spacing and CPU seconds, where they can be told.
    pub next: Option<(f64, f64)>,
}

impl ChosenAccuracy {
    /// The quantity.
    #[must_use]
    pub fn quantity(&self) -> Option<Quantity> {
        let mut errors = Vec::new();
        QuantitySpec::parse(&self.quantity, (), "", &mut errors)?.resolve(None, "", &mut errors)
    }

    /// What a finished run has reached: its value beside those of the levels before it.
    #[must_use]
    pub fn reached(&self, run: KnownLevel, scale: f64, theory: Option<f64>) -> Reached {
        let is_error = self.quantity().is_none_or(|quantity| quantity.is_error());
        let target = Target {
            subject: if is_error { Subject::Error } else { Subject::Value },
            theory,
            tolerance: self.tolerance,
            is_relative: self.relative,
            scale,
        };
        let coarser = self.levels.iter().filter(|level| level.spacing > 1.001 * run.spacing);
        let levels: Vec<Level> = coarser.chain(std::iter::once(&run)).map(|level| Level::from(*level)).collect();
        let judged = assess(&levels, &target);
        let report = AccuracyReport {
            quantity: self.quantity.clone(),
            tolerance: self.tolerance,
            predicted: self.predicted,
            reached: judged.uncertainty,
            met: judged.is_met,
        };
        let cost = crate::convergence::Cost::new(&levels);
        let next = judged.next_spacing.and_then(|spacing| Some((spacing, cost?.at(spacing))));
        Reached { report, next }
    }
}

impl From<&MeasuredLevel> for KnownLevel {
    fn from(level: &MeasuredLevel) -> Self {
        Self { spacing: level.spacing, value: level.value, cpu_s: level.cpu_s }
    }
}

impl From<KnownLevel> for Level {
    fn from(level: KnownLevel) -> Self {
        Self { spacing: level.spacing, value: level.value, cpu_s: level.cpu_s }
    }
}

#[cfg(test)]
mod tests {
    use super::{ChosenAccuracy, KnownLevel};
    use serde_json::json;

    fn chosen(quantity: serde_json::Value) -> ChosenAccuracy {
        let value = |h: f64| if quantity.get("error").is_some() { h * h } else { 5.0 + h * h };
        let levels =
            [0.4, 0.2, 0.1].map(|h| KnownLevel { spacing: h, value: value(h), cpu_s: 1e-3 * h.powi(-3) }).to_vec();
        ChosenAccuracy { quantity, tolerance: 1e-3, relative: false, predicted: 9e-4, basis: String::new(), levels }
    }

    #[test]
    fn errors_are_known_and_values_are_judged_with_the_levels_before() {
        let run = |spacing: f64, value: f64| KnownLevel { spacing, value, cpu_s: 30.0 };
        let error = chosen(json!({"error": {"quantity": "phi", "norm": "rms"}}));
        let met = error.reached(run(0.03, 9e-4), 1.0, None);
        assert!(met.report.met && met.next.is_none());
        assert_eq!(met.report.reached, Some(9e-4));
        let missed = error.reached(run(0.04, 1.6e-3), 1.0, None);
        assert!(!missed.report.met && (0.03..0.033).contains(&missed.next.unwrap().0), "{missed:?}");
        let value = chosen(json!({"report": "/x"}));
        let met = value.reached(run(0.025, 5.0 + 6.25e-4), 1.0, None);
        assert!(met.report.met && met.report.reached.unwrap() > 6.25e-4, "{met:?}");
        // A level as fine as the run says nothing beside it.
        assert!(error.reached(run(0.1, 0.01), 1.0, None).report.reached.unwrap() > 9e-3);
    }
}
