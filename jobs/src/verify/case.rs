//! A verification case: runs, and what must come out of their reports. Each is a JSON file of `tests/validation/cases`.

use super::measure::Measure;
use crate::spec::strict_json;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

/// Why the file of a case or a plot cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}: {place}: {cause}")]
pub struct CaseError {
    /// The file.
    pub file: String,
    /// The place within it, such as `targets[2].measure`.
    pub place: String,
    /// What is wrong there.
    pub cause: String,
}

/// Runs and the targets that they must reach.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// What is computed.
    pub title: String,
    /// Paper with section, table or figure; or what else the targets come from.
    pub source: String,
    /// Why the targets are what they are, where one reason holds for all.
    pub reason: Option<String>,
    /// Scenes or job bodies by name.
    pub runs: Map<String, Value>,
    /// What must come out of them.
    pub targets: Vec<Target>,
}

/// A value that must come out of the reports of runs.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// What is measured.
    pub title: String,
    /// Names of the runs in the order that the measure reads them; all of the case when not given.
    pub runs: Option<Vec<String>>,
    /// How the value comes out of the reports.
    pub measure: Measure,
    /// What the value must be.
    pub bound: Bound,
    /// The value of the paper, or of another program on the same work.
    pub paper: Option<String>,
    /// Where that value or the bound comes from, if not from the source of the case.
    pub source: Option<String>,
    /// Why the bound is what it is.
    pub reason: Option<String>,
    /// Whether the runs take longer than a minute or two. Such a target is only measured when all are asked for.
    #[serde(default)]
    pub is_long: bool,
}

/// What a value must be.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Bound {
    /// Not above.
    AtMost(f64),
    /// Not below.
    AtLeast(f64),
    /// Within a distance of a value.
    Within {
        /// The value.
        value: f64,
        /// The distance.
        tolerance: f64,
    },
    /// No bound: the value is only shown beside the others, but must be a number.
    None,
}

impl Bound {
    /// Whether a value meets the bound; NaN meets none.
    #[must_use]
    pub fn is_met(self, value: f64) -> bool {
        match self {
            Self::AtMost(most) => value <= most,
            Self::AtLeast(least) => value >= least,
            Self::Within { value: wanted, tolerance } => (value - wanted).abs() <= tolerance,
            Self::None => value.is_finite(),
        }
    }
}

/// Whether a JSON value is meant as a case: no scene and no job body has targets.
#[must_use]
pub fn is_case(value: &Value) -> bool {
    value.get("targets").is_some()
}

/// The job body of a run or of a file that `meniscus run` is given: a scene names its kind, a job body its scene.
#[must_use]
pub fn job_body(run: &Value) -> Value {
    if run.get("kind").is_some() { json!({"scene": run}) } else { run.clone() }
}

/// The scene of a job body.
#[must_use]
pub fn scene(body: &Value) -> &Value {
    body.get("scene").unwrap_or(body)
}

impl Case {
    /// A case from the text of its file.
    ///
    /// # Errors
    /// [`CaseError`] with the first place that is wrong.
    pub fn parse(file: &str, text: &[u8]) -> Result<Self, CaseError> {
        let case: Self = parse(file, text)?;
        case.check().map_err(|(place, cause)| CaseError { file: file.to_owned(), place, cause })?;
        Ok(case)
    }

    /// The runs that a target reads, by name and in its order.
    pub fn runs_of<'a>(&'a self, target: &'a Target) -> impl Iterator<Item = (&'a str, &'a Value)> {
        let names: Vec<&str> = match &target.runs {
            Some(names) => names.iter().map(String::as_str).collect(),
            None => self.runs.keys().map(String::as_str).collect(),
        };
        names.into_iter().filter_map(|name| Some((name, self.runs.get(name)?)))
    }

    /// The source of a target: its own, else that of the case.
    #[must_use]
    pub fn source_of<'a>(&'a self, target: &'a Target) -> &'a str {
        target.source.as_deref().unwrap_or(&self.source)
    }

    /// What the types do not tell: names, and numbers of runs.
    fn check(&self) -> Result<(), (String, String)> {
        let at = |place: &str, cause: String| Err((place.to_owned(), cause));
        if self.title.trim().is_empty() || self.source.trim().is_empty() {
            return at("title, source", "a case has a title and a source".to_owned());
        }
        if self.runs.is_empty() {
            return at("runs", "a case has at least one run".to_owned());
        }
        if self.targets.is_empty() {
            return at("targets", "a case has at least one target".to_owned());
        }
        if let Some(name) = self.runs.keys().find(|name| !is_folder_name(name)) {
            let cause = format!("\"{name}\" names a folder: letters, digits, \"_\", \"-\" and \".\", a letter first");
            return at("runs", cause);
        }
        for (k, target) in self.targets.iter().enumerate() {
            if let Some(name) = target.runs.iter().flatten().find(|name| !self.runs.contains_key(*name)) {
                let known = self.runs.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
                return at(
                    &format!("targets[{k}].runs"),
                    format!("there is no run named \"{name}\"; there are {known}"),
                );
            }
            let (count, least) = (self.runs_of(target).count(), target.measure.least_runs());
            if count < least {
                return at(
                    &format!("targets[{k}].runs"),
                    format!("the measure reads at least {least} runs, not {count}"),
                );
            }
        }
        Ok(())
    }
}

/// A value of a type with declared fields from the text of a file.
pub(super) fn parse<T: DeserializeOwned>(file: &str, text: &[u8]) -> Result<T, CaseError> {
    let error = |place: String, cause: String| CaseError { file: file.to_owned(), place, cause };
    let value = strict_json::parse(text)
        .map_err(|cause| error(format!("line {}, column {}", cause.line(), cause.column()), cause.to_string()))?;
    serde_path_to_error::deserialize(value).map_err(|cause| error(cause.path().to_string(), cause.inner().to_string()))
}

fn is_folder_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.bytes().all(|b| b.is_ascii_alphanumeric() || b"_-.".contains(&b))
}

#[cfg(test)]
mod tests;
