//! `after`: jobs that must have succeeded before this one starts.

use super::sources::{JobSource, Sources};
use crate::spec::states::State;
use meniscus::spec::{Json, Object, Parameter, Violation};
use serde_json::json;

/// Jobs that one job may wait for, at most.
const MOST: usize = 1000;

/// Ids of jobs.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct JobIds(pub Vec<String>);

impl Parameter for JobIds {
    type Domain = ();

    fn any() {}

    fn parse(given: &Json, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let Some(list) = given.as_array().filter(|list| list.len() <= MOST) else {
            let detail = "a list of ids of jobs is needed";
            errors.push(Violation::new(place, "type", detail, given.clone(), Self::allowed(())));
            return None;
        };
        let before = errors.len();
        let mut ids: Vec<String> = Vec::new();
        for (k, id) in list.iter().enumerate() {
            match id.as_str() {
                Some(id) if ids.iter().any(|known| known == id) => {}
                Some(id) => ids.push(id.to_owned()),
                None => {
                    let at = format!("{place}/{k}");
                    errors.push(Violation::new(at, "type", "an id is a text", id.clone(), "job_…"));
                }
            }
        }
        (errors.len() == before).then_some(Self(ids))
    }

    fn allowed((): ()) -> Json {
        json!(format!("at most {MOST} ids of jobs, job_…"))
    }

    fn schema((): ()) -> Object {
        Object::from_iter([
            ("type".to_owned(), json!("array")),
            ("items".to_owned(), json!({"type": "string"})),
            ("maxItems".to_owned(), json!(MOST)),
        ])
    }

    fn to_json(&self) -> Json {
        json!(self.0)
    }
}

/// Checks that all jobs are there and may still succeed.
///
/// # Errors
/// When a look-up fails.
pub(super) fn check<S: Sources>(ids: &[String], sources: &S, errors: &mut Vec<Violation>) -> Result<(), S::Error> {
    for (k, id) in ids.iter().enumerate() {
        let at = format!("/after/{k}");
        match sources.job(id)? {
            None => {
                let detail = "there is no such job";
                errors.push(Violation::new(at, "not_found", detail, id.as_str(), "the id of a job, job_…"));
            }
            Some(JobSource { state: state @ (State::Failed | State::Canceled), .. }) => {
                let detail = format!("the job has {}, so this one would never start", past(state));
                let allowed = "a job that has succeeded or may still succeed";
                errors.push(Violation::new(at, "conflict", detail, id.as_str(), allowed));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

fn past(state: State) -> &'static str {
    if state == State::Failed { "failed" } else { "been canceled" }
}
