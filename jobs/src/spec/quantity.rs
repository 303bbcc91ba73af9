//! The one number of a run that a study or an accuracy is about: an error of its report, a number of its series, or any number of
//! its report.

use meniscus::scene::{Scene, SceneKind};
use meniscus::spec::{Json, NOT_NEGATIVE, Violation, Word, suggest};
use serde_json::{Value, json};

/// Norms of errors that are shares of the exact answer already.
const NORMS_OF_SHARES: [&str; 3] = ["relative", "max_relative", "of_measure"];

/// Norms of errors of the quantity's own mean, by which they can be divided. The `mean` of other quantities is one of errors.
const NORMS_OF_MEANS: [&str; 3] = ["mean_error", "std", "std_least"];

/// Beginnings of the observables that a body declares itself (`output.probes`, `output.measures`).
const OWN_OBSERVABLES: [&str; 2] = ["probe.", "measure."];

meniscus::group! {
    /// An error against an exact answer.
    pub struct ErrorSpec {
        /// quantity of the error, such as `phi`
        quantity: String;
        /// norm of the error, one of those of the kind of scene
        norm: String;
    }
}

meniscus::words! {
    /// How a number comes out of a series.
    pub enum SeriesNumber {
        /// the value at `time`, between rows by a cubic; at the end when `time` is not given
        At = "at",
        /// the mean over time from `time` on
        Mean = "mean",
        /// the largest value from `time` on, by a parabola through three rows
        Max = "max",
        /// the least value from `time` on, by a parabola through three rows
        Min = "min",
        /// the first time after `time` at which the value passes zero, by a cubic through four rows
        Zero = "zero",
    }
}

meniscus::group! {
    /// What is judged: one of `error`, `series` and `report`.
    pub struct QuantitySpec {
        /// an error against an exact answer, at `time`, or at its latest time
        error: Option<ErrorSpec>;
        /// an observable of the series; `of` says which number of it
        series: Option<String>;
        /// which number of the series; `at` when not given
        of: Option<SeriesNumber>;
        /// scene time from which on the series counts; of `at` and of an error the time of the value
        time: Option<f64>, in NOT_NEGATIVE;
        /// JSON pointer to a number of the report
        report: Option<String>;
    }
}

/// The number of a run that is judged.
#[derive(Debug, Clone, PartialEq)]
pub enum Quantity {
    /// An error against an exact answer.
    Error {
        /// Quantity of the error.
        quantity: String,
        /// Norm of the error.
        norm: String,
        /// Scene time; the latest one when not given.
        time: Option<f64>,
    },
    /// A number of the series.
    Series {
        /// Observable.
        name: String,
        /// Which number.
        of: SeriesNumber,
        /// Scene time from which on it counts.
        time: Option<f64>,
    },
    /// A number of the report.
    Report {
        /// JSON pointer.
        pointer: String,
    },
}

impl QuantitySpec {
    /// The quantity as JSON, without what was not given.
    #[must_use]
    pub fn as_given(&self) -> Json {
        let mut object = meniscus::spec::Object::new();
        meniscus::spec::Group::write_fields(self, &mut object);
        Json::Object(object.into_iter().filter(|(_, value)| !value.is_null()).collect())
    }

    /// The quantity, with what is wrong with it; `kind` is that of the scene, where it is known.
    pub fn resolve(&self, kind: Option<&SceneKind>, place: &str, errors: &mut Vec<Violation>) -> Option<Quantity> {
        let before = errors.len();
        let named = [self.error.is_some(), self.series.is_some(), self.report.is_some()];
        if named.iter().filter(|is_named| **is_named).count() != 1 {
            let detail = "a quantity is one of an error, a number of the series and a number of the report";
            let allowed = json!([{"error": {"quantity": "phi", "norm": "rms"}}, {"series": "area", "of": "mean"}, {"report": "/cost/steps"}]);
            errors.push(Violation::new(place, "conflict", detail, meniscus::spec::group::to_json(self), allowed));
        }
        let has_value = |name: &'static str, value: Option<Value>, is_meant: bool| {
            let detail = "this does not belong to the quantity";
            let at = format!("{place}/{name}");
            value.filter(|_| !is_meant).map(|value| Violation::new(at, "conflict", detail, value, Value::Null))
        };
        errors.extend(has_value("of", self.of.map(|of| json!(of.word())), self.series.is_some()));
        errors.extend(has_value("time", self.time.map(|time| json!(time)), self.report.is_none()));
        self.check_names(kind, place, errors);
        if errors.len() > before {
            return None;
        }
        let time = self.time;
        let error = self.error.clone().map(|ErrorSpec { quantity, norm }| Quantity::Error { quantity, norm, time });
        let of = self.of.unwrap_or(SeriesNumber::At);
        let series = self.series.clone().map(|name| Quantity::Series { name, of, time: self.time });
        error.or(series).or_else(|| self.report.clone().map(|pointer| Quantity::Report { pointer }))
    }

    /// Names that the kind does not declare.
    fn check_names(&self, kind: Option<&SceneKind>, place: &str, errors: &mut Vec<Violation>) {
        if let Some(pointer) = self.report.as_ref().filter(|pointer| !pointer.starts_with('/')) {
            let detail = "a number of the report is named by a JSON pointer";
            errors.push(Violation::new(
                format!("{place}/report"),
                "type",
                detail,
                pointer.as_str(),
                "/cost/steps, for instance",
            ));
        }
        let Some(kind) = kind else { return };
        let known = (kind.quantities)();
        let mut check = |name: &str, known: Vec<&'static str>, at: &str, detail: &str| {
            let is_own = OWN_OBSERVABLES.iter().any(|beginning| name.starts_with(beginning));
            if !known.contains(&name) && !is_own {
                let at = format!("{place}/{at}");
                let mut violation = Violation::new(at, "unknown", detail, name, Json::from(known.clone()));
                violation.did_you_mean = suggest(name, &known);
                errors.push(violation);
            }
        };
        if let Some(error) = &self.error {
            let norms = known.norms.iter().map(|norm| norm.name).collect();
            check(&error.norm, norms, "error/norm", "reports of this kind of scene have no such norm");
        }
        if let Some(series) = &self.series {
            let names = known.observables.iter().map(|observable| observable.name).collect();
            check(series, names, "series", "series of this kind of scene have no such observable");
        }
    }
}

impl Quantity {
    /// Whether its limit is known to be zero.
    #[must_use]
    pub fn is_error(&self) -> bool {
        matches!(self, Self::Error { .. })
    }

    /// Whether it is an error that is a share of the exact answer already.
    #[must_use]
    pub fn is_share(&self) -> bool {
        matches!(self, Self::Error { norm, .. } if NORMS_OF_SHARES.contains(&norm.as_str()))
    }

    /// Whether a tolerance can be a share of it: values, shares, and errors of a mean.
    #[must_use]
    pub fn has_size(&self) -> bool {
        match self {
            Self::Error { norm, .. } => self.is_share() || NORMS_OF_MEANS.contains(&norm.as_str()),
            Self::Series { .. } | Self::Report { .. } => true,
        }
    }

    /// What is wrong with a tolerance that is a share of it.
    #[must_use]
    pub fn check_relative(&self, is_relative: bool, place: &str) -> Option<Violation> {
        if !is_relative || self.has_size() {
            return None;
        }
        let detail = format!(
            "reports have no size of the exact answer that {} could be a share of; give an absolute tolerance, or a norm that is a share",
            self.label()
        );
        Some(Violation::new(place, "conflict", detail, true, json!({"norms": NORMS_OF_SHARES})))
    }

    /// Order p of its error ~ spacingᵖ that theory gives for a scene; None where none is known.
    #[must_use]
    pub fn order(&self, scene: &dyn Scene) -> Option<f64> {
        let Self::Error { quantity, norm, .. } = self else { return None };
        scene.order(quantity, norm)
    }

    /// The quantity, as charts and messages name it.
    #[must_use]
    pub fn label(&self) -> String {
        match self {
            Self::Error { quantity, norm, time: None } => format!("{quantity}.{norm}"),
            Self::Error { quantity, norm, time: Some(time) } => format!("{quantity}.{norm} at {time}"),
            Self::Series { name, of, time: None } => format!("{name} ({})", of.word()),
            Self::Series { name, of, time: Some(time) } => format!("{name} ({} {time})", of.word()),
            Self::Report { pointer } => pointer.clone(),
        }
    }
}
