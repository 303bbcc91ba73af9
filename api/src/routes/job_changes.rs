//! Changes of jobs: of one that waits, of all that a filter matches, and a new one in place of one that failed.

use crate::access::Client;
use crate::creation::{Creation, check_capacity};
use crate::error::{ApiError, Problem, ProblemItem};
use crate::path::Path;
use crate::query;
use crate::request_body;
use crate::resource;
use crate::routes::jobs::{self, BODY_LIMIT, JobQuery, tag_revision};
use crate::state::AppState;
use crate::store_sources::StoreSources;
use crate::views::{ActionView, JobView, SkippedView};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, header};
use axum::response::Response;
use axum::{Extension, Json};
use meniscus::spec::Word;
use meniscus_jobs::service::store::{Change, ChangeError, JobFilter, JobRow, Store};
use meniscus_jobs::spec::action::{self, Action, ActionSpec};
use meniscus_jobs::spec::body;
use meniscus_jobs::spec::forecast::WORKER_BASE_BYTES;
use meniscus_jobs::spec::states::{Reason, State as JobState, Trigger};

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
        if let Some(study) = row.awaits.as_ref().filter(|_| row.resolved.is_null()) {
            let why = format!("The job has no body to be changed yet: {study} still looks for its spacing.");
            return Err(ApiError::Conflict(why));
        }
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
        let lineage = jobs::Lineage {
            owner: creation.owner.clone(),
            study: old.study.clone().zip(old.study_index),
            retry_of: Some(old.id.clone()),
        };
        creation.respond(jobs::make(&here, store, &body, lineage, creation.keyed.clone())?)
    };
    let response = state.with_store(work).await?;
    state.supervisor.wake();
    Ok(response)
}

/// The trigger of an action with its reason; None of a deletion.
fn trigger_of(action: Action) -> Option<(Trigger, Option<Reason>)> {
    match action {
        Action::Cancel => Some((Trigger::Cancel, Some(Reason::UserCancel))),
        Action::Pause => Some((Trigger::Pause, Some(Reason::UserPause))),
        Action::Resume => Some((Trigger::Resume, None)),
        Action::Delete => None,
    }
}

/// Does an action to one job; the reason why not.
fn act_on(store: &Store, action: Action, job: &JobRow) -> Result<Option<String>, ApiError> {
    let Some((trigger, reason)) = trigger_of(action) else {
        let is_deleted = store.delete(&job.id)?;
        return Ok((!is_deleted).then(|| format!("a job that is {} has not ended", job.state.word())));
    };
    match store.change(&job.id, trigger, &Change { reason, ..Change::default() }) {
        Ok(_) => Ok(None),
        Err(ChangeError::Store(error)) => Err(error.into()),
        Err(error) => Ok(Some(error.to_string())),
    }
}

/// Whether an action would be done to a job in this state; the reason why not.
fn refusal(action: Action, state: JobState) -> Option<String> {
    let can = trigger_of(action).map_or(state.is_terminal(), |(trigger, _)| state.after(trigger).is_some());
    (!can).then(|| format!("a job that is {} cannot {}", state.word(), action.word()))
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
    let ActionSpec { action, filter, dry_run } = action::parse(&body)?;
    let below_filter = |mut item: ProblemItem| {
        item.pointer = format!("/filter/{}", item.pointer);
        item
    };
    let query = query::parse::<JobQuery>(filter.0);
    let query = query.map_err(|found| ApiError::Invalid(found.into_iter().map(below_filter).collect()))?;
    let filter = query.filter(&client);
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
                Ok(()) if dry_run => refusal(action, job.state),
                Ok(()) => act_on(store, action, job)?,
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
