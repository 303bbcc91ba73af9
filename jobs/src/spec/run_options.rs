//! Output, checkpoints and limits of a run: how they are declared, and what they are once everything is filled in.

use crate::spec::own_measures::{Kept, MOST_MEASURES, MeasureSpec, OwnMeasures, ProbeSpec};
use meniscus::simulation::OutputPlan;
use meniscus::spec::{Items, Json, Listed, NOT_NEGATIVE, Object, POSITIVE, Parameter, Violation, Word, whole};
use meniscus::{group, words};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::json;

words! {
    /// Formats of operators.
    pub enum OperatorFormat {
        /// Matrix Market, with a second file for the areas of the points
        MatrixMarket = "matrix_market",
        /// an archive of NumPy arrays, as `scipy.sparse.load_npz` reads it, with the areas of the points as `areas`
        Npz = "npz",
    }
}

impl Serialize for OperatorFormat {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

impl<'de> Deserialize<'de> for OperatorFormat {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        Self::from_word(&word).ok_or_else(|| D::Error::custom(format!("no format of operators: {word}")))
    }
}

group! {
    /// What to write.
    pub struct OutputSpec: Default {
        /// a frame at every multiple of this time; first and last only when not given
        every_time: Option<f64>, in POSITIVE => restart_safe;
        /// fields of frames; all fields of the scene when not given
        fields: Option<FieldNames> => restart_safe;
        /// the operators that a scene makes, as files of this format
        operators: Option<OperatorFormat> => restart_safe;
        /// fields at places in the series
        probes: Option<Listed<ProbeSpec>>, in Items(0, MOST_MEASURES, ()) => restart_safe;
        /// integrals, means and extremes of formulas of fields in the series
        measures: Option<Listed<MeasureSpec>>, in Items(0, MOST_MEASURES, ()) => restart_safe;
        /// a series row every so many steps
        series_every_steps: u64 = 10, in whole(1, u64::MAX) => restart_safe;
    }
}

group! {
    /// When to write checkpoints.
    pub struct CheckpointSpec: Default {
        /// a checkpoint every so many seconds; 60 when neither it nor every_steps is given
        every_wall_s: Option<f64>, in POSITIVE => restart_safe;
        /// a checkpoint every so many steps
        every_steps: Option<u64>, in whole(1, u64::MAX) => restart_safe;
        /// number of verified checkpoints to keep
        keep: u64 = 2, in whole(2, 1000) => restart_safe;
    }
}

group! {
    /// Limits of a job.
    pub struct LimitsSpec: Default {
        /// running time until the job is paused; it counts anew after a resume
        wall_s: Option<f64>, in POSITIVE => restart_safe;
        /// resident memory of the worker; the most that the service gives when not given
        memory_bytes: Option<u64>, in whole(1 << 20, u64::MAX) => restart_safe;
        /// size of all files of the job, checkpoints included
        disk_bytes: Option<f64>, in NOT_NEGATIVE => restart_safe;
        /// threads of the worker; the most that the service gives when not given
        threads: Option<u64>, in whole(1, 1024) => restart_safe;
    }
}

/// Names of fields, as sent: which there are is known with the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldNames(pub Vec<Json>);

impl Parameter for FieldNames {
    type Domain = ();

    fn any() {}

    fn parse(given: &Json, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let list = given.as_array().cloned().map(Self);
        if list.is_none() {
            let detail = "a list of names is needed";
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(())));
        }
        list
    }

    fn allowed((): ()) -> Json {
        json!("a list of fields of the scene")
    }

    fn schema((): ()) -> Object {
        Object::from_iter([("type".to_owned(), json!("array")), ("items".to_owned(), json!({"type": "string"}))])
    }

    fn to_json(&self) -> Json {
        Json::Array(self.0.clone())
    }
}

/// Seconds between checkpoints, where neither they nor steps are given.
const DEFAULT_WALL_S: f64 = 60.0;

/// Everything that a resolved body asks of a run beside its scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunOptions {
    /// What to write.
    pub output: Output,
    /// When to write checkpoints.
    pub checkpoint: Checkpoints,
    /// Limits of the job.
    pub limits: Limits,
}

/// What to write.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Output {
    /// Scene time between frames; the first and the last only where there is none.
    pub every_time: Option<f64>,
    /// Fields of frames.
    pub fields: Vec<String>,
    /// Steps between rows of the series.
    pub series_every_steps: u64,
    /// Fields at places in the series.
    #[serde(default, skip_serializing_if = "Kept::is_empty")]
    pub probes: Kept<ProbeSpec>,
    /// Integrals, means and extremes in the series.
    #[serde(default, skip_serializing_if = "Kept::is_empty")]
    pub measures: Kept<MeasureSpec>,
    /// Format of the files of operators; none are written where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub operators: Option<OperatorFormat>,
}

impl Output {
    /// Probes and measures.
    #[must_use]
    pub fn own_measures(&self) -> OwnMeasures<'_> {
        OwnMeasures { probes: &self.probes.0.0, measures: &self.measures.0.0 }
    }
}

/// When to write checkpoints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoints {
    /// Seconds between checkpoints.
    pub every_wall_s: Option<f64>,
    /// Steps between checkpoints.
    pub every_steps: Option<u64>,
    /// Number of checkpoints to keep.
    pub keep: u64,
}

/// Limits of a job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Running time until the job is paused, in seconds.
    pub wall_s: Option<f64>,
    /// Resident memory of the worker, in bytes.
    pub memory_bytes: u64,
    /// Size of all files, in bytes.
    pub disk_bytes: Option<f64>,
    /// Threads of the worker.
    pub threads: u64,
}

impl RunOptions {
    /// The options of a resolved body.
    ///
    /// # Errors
    /// When the body is not resolved.
    pub fn from_resolved(body: &Json) -> Result<Self, serde_json::Error> {
        Self::deserialize(body)
    }

    /// Threads of the worker.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.limits.threads.max(1) as usize
    }

    /// The plan that the engine sees.
    #[must_use]
    pub fn plan(&self) -> OutputPlan {
        OutputPlan { every_time: self.output.every_time, series_every_steps: self.output.series_every_steps }
    }
}

impl From<CheckpointSpec> for Checkpoints {
    fn from(spec: CheckpointSpec) -> Self {
        let CheckpointSpec { every_wall_s, every_steps, keep } = spec;
        let default = every_steps.is_none().then_some(DEFAULT_WALL_S);
        Self { every_wall_s: every_wall_s.or(default), every_steps, keep }
    }
}
