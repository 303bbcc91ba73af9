//! An action on all jobs that a filter matches.

use meniscus::spec::{Group, Json, Object, Parameter, Violation, group};
use serde_json::{Value, json};

meniscus::words! {
    /// What may be done to many jobs.
    pub enum Action {
        /// drop everything
        Cancel = "cancel",
        /// rest after a checkpoint
        Pause = "pause",
        /// go back to the queue
        Resume = "resume",
        /// take ended jobs and their files away
        Delete = "delete",
    }
}

meniscus::group! {
    /// An action on all jobs that a filter matches.
    pub struct ActionSpec {
        /// what is done
        action: Action;
        /// which jobs: names and values of the query of GET /v1/jobs
        filter: Filter;
        /// whether only to tell what would be done
        dry_run: bool = false;
    }
}

/// Names and texts of a filter that is not empty, so that no slip acts on all jobs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Filter(pub Vec<(String, String)>);

/// Parameters of lists that mean nothing here.
const PAGING: [&str; 3] = ["sort", "limit", "cursor"];

impl Parameter for Filter {
    type Domain = ();

    fn any() {}

    fn parse(given: &Json, (): (), place: &str, errors: &mut Vec<Violation>) -> Option<Self> {
        let Some(filter) = given.as_object().filter(|filter| !filter.is_empty()) else {
            let detail = "a filter that is not empty is needed, so that no slip acts on all jobs";
            errors.push(Violation::new(place, "required", detail, given.clone(), Self::allowed(())));
            return None;
        };
        let before = errors.len();
        for (name, value) in filter.iter().filter(|(name, _)| PAGING.contains(&name.as_str())) {
            let at = format!("{place}/{name}");
            errors.push(Violation::new(at, "unknown_field", "an action has no pages", value.clone(), Value::Null));
        }
        let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let pairs = filter.iter().flat_map(|(name, value)| match value {
            Value::Array(values) => values.iter().map(|value| (name.clone(), text(value))).collect(),
            value => vec![(name.clone(), text(value))],
        });
        (errors.len() == before).then(|| Self(pairs.collect()))
    }

    fn allowed((): ()) -> Json {
        json!({"state": "queued", "label.KEY": "VALUE"})
    }

    fn schema((): ()) -> Object {
        Object::from_iter([("type".to_owned(), json!("object")), ("minProperties".to_owned(), json!(1))])
    }

    fn to_json(&self) -> Json {
        json!(self.0)
    }
}

/// Reads the body of an action.
///
/// # Errors
/// Everything that is wrong with it at once.
pub fn parse(body: &Value) -> Result<ActionSpec, Vec<Violation>> {
    let Value::Object(object) = body else {
        let allowed = json!(ActionSpec::names());
        return Err(vec![Violation::new("", "type", "an action is an object", body.clone(), allowed)]);
    };
    let mut errors = Vec::new();
    group::check_names(object, &ActionSpec::names(), "", &mut errors);
    let parsed = ActionSpec::parse_fields(object, "", &mut errors);
    parsed.filter(|_| errors.is_empty()).ok_or(errors)
}

#[cfg(test)]
mod tests {
    use super::{Action, parse};
    use serde_json::json;

    #[test]
    fn all_that_is_wrong_with_an_action_comes_at_once() {
        let body = json!({"action": "stop", "filters": {}, "filter": {"state": "queued", "limit": 3}, "dry_run": 1});
        let errors = parse(&body).unwrap_err();
        let places: Vec<&str> = errors.iter().map(|error| error.pointer.as_str()).collect();
        for place in ["/filters", "/action", "/dry_run", "/filter/limit"] {
            assert!(places.contains(&place), "{place}: {places:?}");
        }
        for filter in [json!({}), json!(null), json!([])] {
            assert!(parse(&json!({"action": "cancel", "filter": filter})).is_err());
        }
        assert!(parse(&json!({"action": "cancel"})).is_err());
        let spec =
            parse(&json!({"action": "pause", "filter": {"state": ["queued", "paused"], "label.a": "b"}})).unwrap();
        assert_eq!((spec.action, spec.filter.0.len(), spec.dry_run), (Action::Pause, 3, false));
    }
}
