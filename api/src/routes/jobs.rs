//! Jobs: submit, list, get, delete, and requests to them.

use crate::application::Application;
use crate::creation::{Creation, kept};
use crate::error::{ApiError, Problem, ProblemItem};
use crate::routes::{Page, StoreSources, job, with_store};
use crate::views::{JobList, JobView};
use axum::Json;
use axum::body::Bytes;
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use meniscus::scene::Violation;
use meniscus::scene::check::closest;
use meniscus_jobs::service::store::{Change, ChangeError, JobFilter, JobRow, NewJob, Store};
use meniscus_jobs::spec::states::{Reason, State as JobState, Trigger};
use meniscus_jobs::system::clock;
use meniscus_jobs::system::process;
use serde_json::{Value, json};
use std::time::Duration;

/// Bytes of a job's body at most.
pub const BODY_LIMIT: usize = 1 << 20;
/// Longest wait for a change.
const LONGEST_WAIT: u64 = 60;

/// Submits a job. A 201 is durable: it survives whatever happens next.
#[utoipa::path(post, path = "/v1/jobs", tag = "jobs", params(("Idempotency-Key" = Option<String>, Header)),
    request_body(content = Object, description = "a job body: {\"scene\": {\"kind\": …}} at least; see /v1/scenes"),
    responses((status = 201, body = JobView, headers(("Location" = String))), (status = 400, body = Problem),
        (status = 413, body = Problem), (status = 422, body = Problem), (status = 429, body = Problem),
        (status = 503, body = Problem), (status = 507, body = Problem)))]
pub async fn submit(State(application): State<Application>, request: Request) -> Result<Response, ApiError> {
    let mut creation = Creation::take(&application, request, BODY_LIMIT).await?;
    let here = application.clone();
    let response = with_store(&application, move |store| {
        let spec = creation.json()?;
        if let Some(made) = creation.known.take() {
            return creation.answer(made);
        }
        let body = StoreSources::new(store).understand(&spec, here.config.allowance(), &store.calibration()?)?;
        check_room(&here, store, 1, body.forecast.disk_bytes)?;
        let answer = |row: JobRow| kept(StatusCode::CREATED, Some(format!("/v1/jobs/{}", row.id)), &JobView::from(row));
        creation.answer(store.submit(NewJob::of(&body), creation.once.clone(), answer)?)
    })
    .await?;
    application.supervisor.wake();
    Ok(response)
}

/// Refuses what the disk or the operator's quota has no room for.
pub(super) fn check_room(application: &Application, store: &Store, jobs: u64, disk_bytes: u64) -> Result<(), ApiError> {
    let reserve = application.config.disk_reserve_bytes;
    let room = process::free_space(store.directory()).unwrap_or(u64::MAX).saturating_sub(reserve);
    if disk_bytes > room {
        return Err(ApiError::NoSpace { needed: disk_bytes, room });
    }
    if let Some(most) = application.config.most_unfinished {
        let unfinished = store.census()?.unfinished();
        if unfinished + jobs > most {
            return Err(ApiError::QuotaReached { unfinished, most });
        }
    }
    Ok(())
}

/// A page of jobs; inserts never shift pages.
#[utoipa::path(get, path = "/v1/jobs", tag = "jobs",
    params(("state" = Option<String>, Query, description = "one or more states, separated by commas"),
        ("kind" = Option<String>, Query), ("study" = Option<String>, Query), ("name" = Option<String>, Query),
        ("label.KEY" = Option<String>, Query, description = "a label by its key"),
        ("created_after" = Option<String>, Query), ("created_before" = Option<String>, Query),
        ("sort" = Option<String>, Query, description = "created_at or -created_at (default)"),
        ("limit" = Option<u64>, Query), ("cursor" = Option<String>, Query)),
    responses((status = 200, body = JobList, headers(("Link" = String))), (status = 422, body = Problem)))]
pub async fn list(
    State(application): State<Application>,
    Query(query): Query<Vec<(String, String)>>,
) -> Result<Response, ApiError> {
    page(&application, "/v1/jobs", &query, None).await
}

/// A page of jobs, of one study or of all.
pub(super) async fn page(
    application: &Application,
    path: &str,
    query: &[(String, String)],
    study: Option<String>,
) -> Result<Response, ApiError> {
    let mut filter = filter(query)?;
    let others: Vec<&str> = query.iter().map(|(name, _)| name.as_str()).collect();
    let page = Page::of(query, &others)?;
    filter.limit = page.limit + 1;
    filter.cursor.clone_from(&page.cursor);
    filter.study = study.or(filter.study);
    let rows = with_store(application, move |store| Ok(store.list(&filter)?)).await?;
    Ok(page.answer(
        path,
        rows,
        |row| row.id.clone(),
        |items, next| JobList { items: items.into_iter().map(JobView::from).collect(), next },
    ))
}

fn filter(query: &[(String, String)]) -> Result<JobFilter, ApiError> {
    const KNOWN: [&str; 9] =
        ["state", "kind", "study", "name", "created_after", "created_before", "sort", "limit", "cursor"];
    let mut filter = JobFilter::default();
    let mut errors: Vec<ProblemItem> = Vec::new();
    let refuse = |name: &str, code: &'static str, detail: &str, got: &str, allowed: Value| {
        Violation::new(name, code, detail, &json!(got), allowed)
    };
    for (name, value) in query {
        match name.as_str() {
            "state" => {
                for word in value.split(',') {
                    match JobState::from_word(word) {
                        Some(state) => filter.states.push(state),
                        None => {
                            let words: Vec<&str> = JobState::ALL.iter().map(|s| s.word()).collect();
                            errors
                                .push(refuse("state", "unknown", "there is no such state", word, json!(words)).into());
                        }
                    }
                }
            }
            "kind" => filter.kind = Some(value.clone()),
            "study" => filter.study = Some(value.clone()),
            "name" => filter.name = Some(value.clone()),
            "created_after" | "created_before" => match clock::parse(value) {
                Some(time) if name == "created_after" => filter.created_after = Some(time),
                Some(time) => filter.created_before = Some(time),
                None => {
                    let allowed = json!("a time such as 2026-11-22T01:39:32Z");
                    errors.push(refuse(name, "type", "an RFC 3339 time is needed", value, allowed).into());
                }
            },
            "cursor" | "limit" => {}
            "sort" => match value.as_str() {
                "created_at" => filter.oldest_first = true,
                "-created_at" => filter.oldest_first = false,
                _ => {
                    let allowed = json!(["created_at", "-created_at"]);
                    errors.push(refuse("sort", "unknown", "there is no such order", value, allowed).into());
                }
            },
            other => match other.strip_prefix("label.") {
                Some(key) => filter.labels.push((key.to_owned(), value.clone())),
                None => {
                    let mut violation = refuse(other, "unknown", "there is no such filter", value, json!(KNOWN));
                    violation.did_you_mean = closest(other, &KNOWN);
                    errors.push(violation.into());
                }
            },
        }
    }
    if errors.is_empty() { Ok(filter) } else { Err(ApiError::Invalid(errors)) }
}

/// The entity tag of a version.
fn tag((rev, progress): (i64, i64)) -> String {
    format!("\"{rev}-{progress}\"")
}

/// The revision of a tag `"REV-PROGRESS"`.
fn tag_revision(tag: &str) -> Option<i64> {
    tag.trim_start_matches("W/").trim_matches('"').split('-').next()?.parse().ok()
}

/// A job. With `If-None-Match` 304 while nothing has changed; with `Prefer: wait=N` as well, the answer comes as soon
/// as the revision differs, or after N seconds with the fresh job.
#[utoipa::path(get, path = "/v1/jobs/{id}", tag = "jobs",
    params(("id" = String, Path), ("If-None-Match" = Option<String>, Header), ("Prefer" = Option<String>, Header)),
    responses((status = 200, body = JobView, headers(("ETag" = String))), (status = 304), (status = 404, body = Problem)))]
pub async fn get(
    State(application): State<Application>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let text = |name: header::HeaderName| headers.get(name).and_then(|v| v.to_str().ok()).map(str::to_owned);
    let known = text(header::IF_NONE_MATCH);
    let wait = text(header::HeaderName::from_static("prefer"))
        .and_then(|prefer| prefer.split(',').find_map(|p| p.trim().strip_prefix("wait=")?.parse::<u64>().ok()));
    let mut changes = application.store.watch();
    // Two numbers by their key are read in less time than it takes to hand that to another thread.
    let look = || application.store.version(&id)?.ok_or(ApiError::NotFound("job"));
    let mut version = look()?;
    if let (Some(known), Some(wait)) = (&known, wait) {
        let mut stopping = application.stopping.clone();
        let deadline = tokio::time::sleep(Duration::from_secs(wait.min(LONGEST_WAIT)));
        tokio::pin!(deadline);
        while tag_revision(known) == Some(version.0) {
            tokio::select! {
                () = &mut deadline => break,
                _ = stopping.changed() => break,
                _ = changes.changed() => version = look()?,
            }
        }
        version = look()?;
    } else if known.as_deref() == Some(tag(version).as_str()) {
        return Ok((StatusCode::NOT_MODIFIED, [(header::ETAG, tag(version))]).into_response());
    }
    if let Some(bytes) = application.shown.get(&id, version) {
        return Ok(shown(version, bytes));
    }
    let row = job(&application, &id).await?;
    let version = (row.rev, row.progress_count);
    let bytes: Bytes = serde_json::to_vec(&JobView::from(row)).map_err(|e| ApiError::Internal(e.to_string()))?.into();
    application.shown.put(&id, version, bytes.clone());
    Ok(shown(version, bytes))
}

fn shown(version: (i64, i64), bytes: Bytes) -> Response {
    ([(header::CONTENT_TYPE, "application/json".to_owned()), (header::ETAG, tag(version))], bytes).into_response()
}

/// Deletes a terminal job and its files; never cancels.
#[utoipa::path(delete, path = "/v1/jobs/{id}", tag = "jobs", params(("id" = String, Path)),
    responses((status = 204), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn delete(State(application): State<Application>, Path(id): Path<String>) -> Result<StatusCode, ApiError> {
    let row = job(&application, &id).await?;
    let deleted = with_store(&application, move |store| Ok(store.delete(&id)?)).await?;
    if deleted {
        return Ok(StatusCode::NO_CONTENT);
    }
    Err(ApiError::Conflict(format!("a job that is {} cannot be deleted; cancel it first", row.state.word())))
}

/// Applies a trigger; a job that already is where it leads stays there.
async fn request(
    application: &Application,
    id: String,
    trigger: Trigger,
    reason: Option<Reason>,
    already: &'static [JobState],
) -> Result<Response, ApiError> {
    let change = Change { reason, ..Change::default() };
    let row = with_store(application, move |store| {
        match store.change(&id, trigger, &change) {
            Err(ChangeError::Illegal(state, _)) if already.contains(&state) => {
                if trigger == Trigger::Pause {
                    store.keep_paused(&id)?;
                }
                store.job(&id)?.ok_or(ApiError::NotFound("job"))
            }
            // Somebody else changed it in the same moment: once more, on what it is now.
            Err(ChangeError::Stale) => Ok(store.change(&id, trigger, &change)?),
            result => Ok(result?),
        }
    })
    .await?;
    application.supervisor.wake();
    Ok((StatusCode::ACCEPTED, Json(JobView::from(row))).into_response())
}

/// Cancels a job. Idempotent.
#[utoipa::path(post, path = "/v1/jobs/{id}/cancel", tag = "jobs", params(("id" = String, Path)),
    responses((status = 202, body = JobView), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn cancel(State(application): State<Application>, Path(id): Path<String>) -> Result<Response, ApiError> {
    let already = &[JobState::Canceling, JobState::Canceled];
    request(&application, id, Trigger::Cancel, Some(Reason::UserCancel), already).await
}

/// Pauses a job after a checkpoint at the end of its step. Idempotent.
#[utoipa::path(post, path = "/v1/jobs/{id}/pause", tag = "jobs", params(("id" = String, Path)),
    responses((status = 202, body = JobView), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn pause(State(application): State<Application>, Path(id): Path<String>) -> Result<Response, ApiError> {
    let already = &[JobState::Pausing, JobState::Paused];
    request(&application, id, Trigger::Pause, Some(Reason::UserPause), already).await
}

/// Puts a paused job back into the queue. Idempotent.
#[utoipa::path(post, path = "/v1/jobs/{id}/resume", tag = "jobs", params(("id" = String, Path)),
    responses((status = 202, body = JobView), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn resume(State(application): State<Application>, Path(id): Path<String>) -> Result<Response, ApiError> {
    request(&application, id, Trigger::Resume, None, &[JobState::Queued, JobState::Running]).await
}
