//! Changes of jobs: of one that waits, of all that a filter matches, and a new one in place of one that failed.

use crate::access::Client;
use crate::base_path::address;
use crate::creation::{Creation, check_capacity};
use crate::error::{ApiError, Problem};
use crate::idempotency::stored_response;
use crate::path::Path;
use crate::query;
use crate::request_body;
use crate::resource;
use crate::routes::jobs::{BODY_LIMIT, JobQuery, tag_revision};
use crate::state::AppState;
use crate::store_sources::StoreSources;
use crate::views::{ActionView, JobView, SkippedView};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use meniscus::spec::suggest;
use meniscus_jobs::service::store::{Change, ChangeError, JobFilter, JobRow, NewJob, Store};
use meniscus_jobs::spec::body;
use meniscus_jobs::spec::forecast::WORKER_BASE_BYTES;
use meniscus_jobs::spec::states::{Reason, State as JobState, Trigger};
use serde_json::{Value, json};

/// Changes name, labels, priority or limits of a job that waits, by a JSON merge patch. With `If-Match` only the given revision
/// is changed.
#[utoipa::path(patch, path = "/v1/jobs/{id}", operation_id = "change_job", tag = "jobs",
    params(("id" = String, Path), ("If-Match" = Option<String>, Header)),
    request_body(content = Object, description = "name, labels, priority, limits; null takes a value away", content_type = "application/merge-patch+json"),
    responses((status = 200, body = JobView), (status = 404, body = Problem), (status = 409, body = Problem),
        (status = 412, body = Problem, description = "The job has another revision."), (status = 422, body = Problem)))]
pub async fn change(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
    request: Request,
) -> Result<Json<JobView>, ApiError> {
    let (parts, body) = request.into_parts();
    let row = resource::find_own::<JobRow>(&state, &client, id).await?;
    let wanted = revision_of(&parts.headers)?;
    let patch = request_body::parse_json(&request_body::read(&parts.headers, body, BODY_LIMIT).await?)?;
    if wanted.is_some_and(|rev| rev != row.rev) {
        return Err(ApiError::Changed);
    }
    let allowance = state.config.allowance();
    let work = move |store: &Store| {
        let needed = row.forecast.memory_bytes.max(WORKER_BASE_BYTES);
        let amended = body::amend(&row.spec, &row.resolved, &patch, allowance, needed)?;
        if !matches!(row.state, JobState::Queued | JobState::Paused) {
            let why =
                format!("The job is {}. Only queued and paused jobs can be changed; pause it first.", row.state.word());
            return Err(ApiError::Conflict(why));
        }
        match store.amend(&row.id, row.rev, &amended) {
            Err(ChangeError::Stale) if wanted.is_some() => Err(ApiError::Changed),
            changed => Ok(changed?),
        }
    };
    let changed = state.with_store(work).await?;
    state.supervisor.wake();
    Ok(Json(JobView::from(changed)))
}

/// The revision that `If-Match` names; None for any.
fn revision_of(headers: &HeaderMap) -> Result<Option<i64>, ApiError> {
    let Some(value) = headers.get(header::IF_MATCH) else { return Ok(None) };
    let text = value.to_str().unwrap_or_default();
    if text.trim() == "*" {
        return Ok(None);
    }
    tag_revision(text).map(Some).ok_or_else(|| {
        let allowed = "the ETag of the job, \"REV-PROGRESS\"".into();
        ApiError::invalid("If-Match", "type", "the tag cannot be read", &text.into(), allowed)
    })
}

/// Makes a new job with the body of one that failed or was canceled.
#[utoipa::path(post, path = "/v1/jobs/{id}/retry", operation_id = "retry_job", tag = "jobs",
    params(("id" = String, Path), ("Idempotency-Key" = Option<String>, Header)),
    responses((status = 201, body = JobView, headers(("Location" = String))), (status = 404, body = Problem), (status = 409, body = Problem),
        (status = 422, body = Problem), (status = 429, body = Problem), (status = 507, body = Problem)))]
pub async fn retry(
    State(state): State<AppState>,
    Path(id): Path<String>,
    request: Request,
) -> Result<Response, ApiError> {
    let old = resource::find::<JobRow>(&state, id).await?;
    let mut creation = Creation::receive(&state, request, BODY_LIMIT).await?;
    let here = state.clone();
    let work = move |store: &Store| {
        if let Some(made) = creation.known.take() {
            return creation.respond(made);
        }
        if !matches!(old.state, JobState::Failed | JobState::Canceled) {
            let why = format!("The job is {}. Only failed and canceled jobs can be repeated.", old.state.word());
            return Err(ApiError::Conflict(why));
        }
        let body = StoreSources::new(store).resolve(&old.spec, here.config.allowance(), &store.calibration()?)?;
        check_capacity(&here, store, 1, body.forecast.disk_bytes)?;
        let mut job = NewJob::from_body(&body);
        job.owner.clone_from(&creation.owner);
        job.study = old.study.clone().zip(old.study_index);
        job.retry_of = Some(old.id.clone());
        let answer = |row: JobRow| {
            let location = address(&format!("/v1/jobs/{}", row.id));
            stored_response(StatusCode::CREATED, Some(location), &JobView::from(row))
        };
        creation.respond(store.submit(job, creation.keyed.clone(), answer)?)
    };
    let response = state.with_store(work).await?;
    state.supervisor.wake();
    Ok(response)
}

/// What may be done to all jobs that a filter matches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Action {
    Cancel,
    Pause,
    Resume,
    Delete,
}

impl Action {
    const WORDS: [(&'static str, Self); 4] =
        [("cancel", Self::Cancel), ("pause", Self::Pause), ("resume", Self::Resume), ("delete", Self::Delete)];

    /// Does it to one job; the reason why not.
    fn act(self, store: &Store, job: &JobRow) -> Result<Option<String>, ApiError> {
        let trigger = match self {
            Self::Cancel => (Trigger::Cancel, Some(Reason::UserCancel)),
            Self::Pause => (Trigger::Pause, Some(Reason::UserPause)),
            Self::Resume => (Trigger::Resume, None),
            Self::Delete if store.delete(&job.id)? => return Ok(None),
            Self::Delete => return Ok(Some(format!("the job is {} and has not ended", job.state.word()))),
        };
        let change = Change { reason: trigger.1, ..Change::default() };
        match store.change(&job.id, trigger.0, &change) {
            Ok(_) => Ok(None),
            Err(ChangeError::Store(error)) => Err(error.into()),
            Err(error) => Ok(Some(error.to_string())),
        }
    }

    /// Whether it would be done to a job in this state; the reason why not.
    fn refusal(self, state: JobState) -> Option<String> {
        let can = match self {
            Self::Cancel => state.after(Trigger::Cancel).is_some(),
            Self::Pause => state.after(Trigger::Pause).is_some(),
            Self::Resume => state.after(Trigger::Resume).is_some(),
            Self::Delete => state.is_terminal(),
        };
        let word = Self::WORDS.iter().find(|(_, action)| *action == self).map_or("", |(word, _)| word);
        (!can).then(|| format!("a job that is {} cannot {word}", state.word()))
    }
}

/// Jobs that are read at once.
const CHUNK: u64 = 200;
/// Skipped jobs that an answer lists; the rest is counted.
const MOST_SKIPPED: usize = 1000;

/// Cancels, pauses, resumes or deletes all jobs that a filter matches. The filter has the names and values of the query of
/// `GET /v1/jobs` and must not be empty. With `dry_run` nothing is changed.
#[utoipa::path(post, path = "/v1/jobs/actions", operation_id = "act_on_jobs", tag = "jobs",
    request_body(content = Object, description = "{\"action\": \"cancel\" | \"pause\" | \"resume\" | \"delete\", \"filter\": {…}, \"dry_run\": false}"),
    responses((status = 200, body = ActionView), (status = 422, body = Problem)))]
pub async fn act(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    request: Request,
) -> Result<Json<ActionView>, ApiError> {
    let (parts, body) = request.into_parts();
    let body = request_body::parse_json(&request_body::read(&parts.headers, body, BODY_LIMIT).await?)?;
    let Wish { action, filter, dry_run } = parse(&body)?;
    let filter = filter.filter(&client);
    let work = move |store: &Store| act_on_all(store, &client, action, &filter, dry_run);
    let view = state.with_store(work).await?;
    state.supervisor.wake();
    Ok(Json(view))
}

fn act_on_all(
    store: &Store,
    client: &Client,
    action: Action,
    filter: &JobFilter,
    dry_run: bool,
) -> Result<ActionView, ApiError> {
    let mut view = ActionView { matched: 0, changed: 0, dry_run, skipped: Vec::new() };
    let mut filter = JobFilter { limit: CHUNK, oldest_first: true, cursor: None, ..filter.clone() };
    loop {
        let jobs = store.list(&filter)?;
        for job in &jobs {
            view.matched += 1;
            let refusal = match resource::check_owner(client, job.owner.clone()) {
                Err(_) => Some(format!("it belongs to {}", job.owner.as_deref().unwrap_or_default())),
                Ok(()) if dry_run => action.refusal(job.state),
                Ok(()) => action.act(store, job)?,
            };
            match refusal {
                None => view.changed += 1,
                Some(reason) if view.skipped.len() < MOST_SKIPPED => {
                    view.skipped.push(SkippedView { job: job.id.clone(), reason });
                }
                Some(_) => {}
            }
        }
        match jobs.last() {
            Some(last) => filter.cursor = Some(last.id.clone()),
            None => return Ok(view),
        }
    }
}

/// The body of an action.
struct Wish {
    action: Action,
    filter: JobQuery,
    dry_run: bool,
}

/// Names of the fields of the body.
const NAMES: [&str; 3] = ["action", "filter", "dry_run"];
/// Parameters of lists that mean nothing here.
const PAGING: [&str; 3] = ["sort", "limit", "cursor"];

fn parse(body: &Value) -> Result<Wish, ApiError> {
    let mut errors = Vec::new();
    let mut add = |pointer: &str, code: &'static str, detail: &str, got: &Value, allowed: Value| {
        if let ApiError::Invalid(found) = ApiError::invalid(pointer, code, detail, got, allowed) {
            errors.extend(found);
        }
    };
    let Some(object) = body.as_object() else {
        return Err(ApiError::invalid("", "type", "an action is an object", body, json!(NAMES)));
    };
    for (name, value) in object.iter().filter(|(name, _)| !NAMES.contains(&name.as_str())) {
        let similar = suggest(name, &NAMES).map(|name| format!(" (did you mean {name}?)")).unwrap_or_default();
        add(&format!("/{name}"), "unknown_field", &format!("there is no such field{similar}"), value, json!(NAMES));
    }
    let words: Vec<&str> = Action::WORDS.iter().map(|(word, _)| *word).collect();
    let sent = object.get("action").unwrap_or(&Value::Null);
    let action = Action::WORDS.iter().find(|(word, _)| sent == word).map(|(_, action)| *action);
    if action.is_none() {
        add("/action", "unknown", "there is no such action", sent, json!(words));
    }
    let dry_run = match object.get("dry_run") {
        None => Some(false),
        Some(value) => value.as_bool(),
    };
    if dry_run.is_none() {
        add("/dry_run", "type", "true or false is needed", &object["dry_run"], json!([true, false]));
    }
    let filter = object.get("filter").and_then(Value::as_object).filter(|filter| !filter.is_empty());
    let filter = match filter {
        None => {
            let detail = "a filter that is not empty is needed, so that no slip acts on all jobs";
            let got = object.get("filter").unwrap_or(&Value::Null);
            add("/filter", "required", detail, got, json!({"state": "queued", "label.KEY": "VALUE"}));
            None
        }
        Some(filter) => {
            let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            let pairs: Vec<(String, String)> = filter
                .iter()
                .flat_map(|(name, value)| match value {
                    Value::Array(values) => values.iter().map(|value| (name.clone(), text(value))).collect(),
                    value => vec![(name.clone(), text(value))],
                })
                .collect();
            for (name, value) in filter.iter().filter(|(name, _)| PAGING.contains(&name.as_str())) {
                add(&format!("/filter/{name}"), "unknown_field", "an action has no pages", value, Value::Null);
            }
            query::parse::<JobQuery>(pairs)
                .map_err(|found| {
                    errors.extend(found.into_iter().map(|mut item| {
                        item.pointer = format!("/filter/{}", item.pointer);
                        item
                    }));
                })
                .ok()
        }
    };
    match (action, filter, dry_run) {
        (Some(action), Some(filter), Some(dry_run)) if errors.is_empty() => Ok(Wish { action, filter, dry_run }),
        _ => Err(ApiError::Invalid(errors)),
    }
}

impl IntoResponse for ActionView {
    fn into_response(self) -> Response {
        Json(self).into_response()
    }
}

#[cfg(test)]
mod tests {
    use super::parse;
    use crate::error::ApiError;
    use serde_json::json;

    #[test]
    fn all_that_is_wrong_with_an_action_comes_at_once() {
        let Err(ApiError::Invalid(errors)) =
            parse(&json!({"action": "stop", "filters": {}, "filter": {"stat": "queued", "limit": 3}, "dry_run": 1}))
        else {
            panic!("it was taken")
        };
        let places: Vec<&str> = errors.iter().map(|error| error.pointer.as_str()).collect();
        for place in ["/filters", "/action", "/dry_run", "/filter/stat", "/filter/limit"] {
            assert!(places.contains(&place), "{place}: {places:?}");
        }
        for filter in [json!({}), json!(null), json!([])] {
            assert!(parse(&json!({"action": "cancel", "filter": filter})).is_err());
        }
        assert!(parse(&json!({"action": "cancel", "filter": {"state": ["queued", "paused"], "label.a": "b"}})).is_ok());
    }
}
