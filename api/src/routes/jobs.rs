//! Jobs: submit, list, get, delete, and requests to them.

use crate::application::Application;
use crate::error::{ApiError, Problem, ProblemItem};
use crate::routes::{job, with_store};
use crate::views::{JobList, JobView};
use axum::Json;
use axum::body::Body;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use meniscus::scene::Violation;
use meniscus::scene::check::closest;
use meniscus_jobs::job::{Reason, State as JobState, Trigger};
use meniscus_jobs::store::{Change, ChangeError, JobFilter, JobRow};
use meniscus_jobs::supervisor::DISK_RESERVE_BYTES;
use meniscus_jobs::{body, clock, process, strict_json};
use serde_json::{Value, json};
use std::time::Duration;

/// Bytes of a job's body at most.
pub const BODY_LIMIT: usize = 1 << 20;
/// Longest wait for a change.
const LONGEST_WAIT: u64 = 60;
/// Jobs on a page when nothing is said, and at most.
const PAGE: (u64, u64) = (50, 500);

/// Submits a job. A 201 is durable: it survives whatever happens next.
#[utoipa::path(post, path = "/v1/jobs", tag = "jobs",
    request_body(content = Object, description = "a job body: {\"scene\": {\"kind\": …}} at least; see /v1/scenes"),
    responses((status = 201, body = JobView, headers(("Location" = String))), (status = 400, body = Problem),
        (status = 413, body = Problem), (status = 422, body = Problem), (status = 503, body = Problem), (status = 507, body = Problem)))]
pub async fn submit(
    State(application): State<Application>,
    headers: HeaderMap,
    content: Body,
) -> Result<Response, ApiError> {
    let announced =
        headers.get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok()).and_then(|v| v.parse::<usize>().ok());
    if announced.is_some_and(|length| length > BODY_LIMIT) {
        return Err(ApiError::TooLarge(BODY_LIMIT));
    }
    let bytes = axum::body::to_bytes(content, BODY_LIMIT).await.map_err(|error| {
        let text = std::error::Error::source(&error).map_or_else(|| error.to_string(), ToString::to_string);
        if text.contains("length limit") { ApiError::TooLarge(BODY_LIMIT) } else { ApiError::Unparsable(text) }
    })?;
    let allowance = application.config.allowance();
    let row = with_store(&application, move |store| {
        let spec = strict_json::parse(&bytes).map_err(|error| ApiError::Unparsable(error.to_string()))?;
        // A failing store is not a missing checkpoint.
        let mut failure = None;
        let find = |id: &str| {
            store.restart_source(id).unwrap_or_else(|error| {
                failure = Some(error);
                None
            })
        };
        let body = body::parse(&spec, allowance, find);
        if let Some(error) = failure {
            return Err(error.into());
        }
        let body = body?;
        let room = process::free_space(store.directory()).unwrap_or(u64::MAX).saturating_sub(DISK_RESERVE_BYTES);
        if body.disk_bytes > room {
            return Err(ApiError::NoSpace { needed: body.disk_bytes, room });
        }
        Ok(store.submit(&body)?)
    })
    .await?;
    application.supervisor.wake();
    let location =
        HeaderValue::from_str(&format!("/v1/jobs/{}", row.id)).map_err(|e| ApiError::Internal(e.to_string()))?;
    let mut response = (StatusCode::CREATED, Json(JobView::from(row))).into_response();
    response.headers_mut().insert(header::LOCATION, location);
    Ok(response)
}

/// A page of jobs; inserts never shift pages.
#[utoipa::path(get, path = "/v1/jobs", tag = "jobs",
    params(("state" = Option<String>, Query, description = "one or more states, separated by commas"),
        ("kind" = Option<String>, Query), ("name" = Option<String>, Query),
        ("label.KEY" = Option<String>, Query, description = "a label by its key"),
        ("created_after" = Option<String>, Query), ("created_before" = Option<String>, Query),
        ("sort" = Option<String>, Query, description = "created_at or -created_at (default)"),
        ("limit" = Option<u64>, Query), ("cursor" = Option<String>, Query)),
    responses((status = 200, body = JobList, headers(("Link" = String))), (status = 422, body = Problem)))]
pub async fn list(
    State(application): State<Application>,
    Query(query): Query<Vec<(String, String)>>,
) -> Result<Response, ApiError> {
    let mut filter = filter(&query)?;
    let limit = filter.limit;
    filter.limit += 1;
    let mut rows = with_store(&application, move |store| Ok(store.list(&filter)?)).await?;
    let more = rows.len() as u64 > limit;
    rows.truncate(limit as usize);
    let next = rows.last().filter(|_| more).map(|row| row.id.clone());
    let link = next.as_ref().map(|cursor| next_link(&query, cursor));
    let body = JobList { items: rows.into_iter().map(JobView::from).collect(), next };
    let mut response = Json(body).into_response();
    if let Some(link) = link.and_then(|link| HeaderValue::from_str(&link).ok()) {
        response.headers_mut().insert(header::LINK, link);
    }
    Ok(response)
}

fn next_link(query: &[(String, String)], cursor: &str) -> String {
    let escape = |text: &str| {
        text.bytes()
            .map(|b| {
                if b.is_ascii_alphanumeric() || b"-._~".contains(&b) {
                    char::from(b).to_string()
                } else {
                    format!("%{b:02X}")
                }
            })
            .collect::<String>()
    };
    let mut parts: Vec<String> = query
        .iter()
        .filter(|(name, _)| name != "cursor")
        .map(|(name, value)| format!("{}={}", escape(name), escape(value)))
        .collect();
    parts.push(format!("cursor={}", escape(cursor)));
    format!("</v1/jobs?{}>; rel=\"next\"", parts.join("&"))
}

fn filter(query: &[(String, String)]) -> Result<JobFilter, ApiError> {
    const KNOWN: [&str; 8] = ["state", "kind", "name", "created_after", "created_before", "sort", "limit", "cursor"];
    let mut filter = JobFilter { limit: PAGE.0, ..JobFilter::default() };
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
            "name" => filter.name = Some(value.clone()),
            "created_after" | "created_before" => match clock::parse(value) {
                Some(time) if name == "created_after" => filter.created_after = Some(time),
                Some(time) => filter.created_before = Some(time),
                None => {
                    let allowed = json!("a time such as 2026-11-22T01:39:32Z");
                    errors.push(refuse(name, "type", "an RFC 3339 time is needed", value, allowed).into());
                }
            },
            "cursor" => filter.cursor = Some(value.clone()),
            "sort" => match value.as_str() {
                "created_at" => filter.oldest_first = true,
                "-created_at" => filter.oldest_first = false,
                _ => {
                    let allowed = json!(["created_at", "-created_at"]);
                    errors.push(refuse("sort", "unknown", "there is no such order", value, allowed).into());
                }
            },
            "limit" => match value.parse::<u64>() {
                Ok(limit) if (1..=PAGE.1).contains(&limit) => filter.limit = limit,
                _ => {
                    let allowed = json!(format!("1 to {}", PAGE.1));
                    errors.push(refuse("limit", "range", "a whole number is needed", value, allowed).into());
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

fn tag(row: &JobRow) -> String {
    format!("\"{}-{}\"", row.rev, row.progress_count)
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
    let mut row = job(&application, &id).await?;
    if let (Some(known), Some(wait)) = (&known, wait) {
        let mut stopping = application.stopping.clone();
        let deadline = tokio::time::sleep(Duration::from_secs(wait.min(LONGEST_WAIT)));
        tokio::pin!(deadline);
        while tag_revision(known) == Some(row.rev) {
            tokio::select! {
                () = &mut deadline => break,
                _ = stopping.changed() => break,
                _ = changes.changed() => row = job(&application, &id).await?,
            }
        }
        row = job(&application, &id).await?;
    } else if known.as_deref() == Some(tag(&row).as_str()) {
        return Ok((StatusCode::NOT_MODIFIED, [(header::ETAG, tag(&row))]).into_response());
    }
    let tag = HeaderValue::from_str(&tag(&row)).map_err(|e| ApiError::Internal(e.to_string()))?;
    let mut response = Json(JobView::from(row)).into_response();
    response.headers_mut().insert(header::ETAG, tag);
    Ok(response)
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
