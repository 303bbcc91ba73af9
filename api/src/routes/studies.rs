//! Studies: sweeps of jobs as one object.

use crate::application::Application;
use crate::creation::{Creation, kept};
use crate::error::{ApiError, Problem};
use crate::routes::{Page, StoreSources, accepts, flag, jobs, number, refuse_unknown, with_store};
use crate::views::{DryRunView, JobList, StudyList, StudyView};
use axum::Json;
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use meniscus_jobs::service::store::{Change, Made, NewJob, StudyRow};
use meniscus_jobs::service::study_report;
use meniscus_jobs::service::study_table;
use meniscus_jobs::spec::states::{Reason, State as JobState, Trigger};
use meniscus_jobs::spec::study;

/// Bytes of a study's body at most: ten thousand points of a list.
pub const BODY_LIMIT: usize = 16 << 20;
/// Rows of a table when nothing is said: all.
const ALL_POINTS: u64 = study::MOST_POINTS as u64;

/// Makes a study with all its jobs, or says all that is wrong and makes nothing. `?dry_run=true` makes nothing either and
/// tells the points and what they would take.
#[utoipa::path(post, path = "/v1/studies", tag = "studies",
    params(("dry_run" = Option<bool>, Query), ("Idempotency-Key" = Option<String>, Header)),
    request_body(content = Object, description = "{\"base\": a job body, \"sweep\": {\"mode\": \"grid\" | \"zip\" | \"list\", …}, \"max_parallel\", \"on_failure\"}"),
    responses((status = 201, body = StudyView, headers(("Location" = String))), (status = 200, body = DryRunView, description = "a dry run"),
        (status = 400, body = Problem), (status = 413, body = Problem), (status = 422, body = Problem), (status = 429, body = Problem),
        (status = 503, body = Problem), (status = 507, body = Problem)))]
pub async fn submit(
    State(application): State<Application>,
    Query(query): Query<Vec<(String, String)>>,
    request: Request,
) -> Result<Response, ApiError> {
    refuse_unknown(&query, &["dry_run"])?;
    let is_dry = flag(&query, "dry_run")?;
    let mut creation = Creation::take(&application, request, BODY_LIMIT).await?;
    let here = application.clone();
    let response = with_store(&application, move |store| {
        let spec = creation.json()?;
        if let Some(made) = creation.known.take() {
            return creation.answer(made);
        }
        let sources = StoreSources::new(store);
        let (allowance, slots) = (here.config.allowance(), here.config.slots);
        let study = study::parse(&spec, allowance, slots, &sources, &store.calibration()?);
        sources.check()?;
        let study = study?;
        if is_dry {
            let view = DryRunView { points: study.points, estimate: study.new.estimate };
            return Ok(Json(view).into_response());
        }
        jobs::check_room(&here, store, study.new.jobs.len() as u64, study.total.disk_bytes)?;
        let answer = |row: &StudyRow| {
            kept(StatusCode::CREATED, Some(format!("/v1/studies/{}", row.id)), &StudyView::from(row.clone()))
        };
        creation.answer(store.make_study(study.new, creation.once.as_ref(), answer)?)
    })
    .await?;
    application.supervisor.wake();
    Ok(response)
}

/// A page of studies, newest first; inserts never shift pages.
#[utoipa::path(get, path = "/v1/studies", tag = "studies",
    params(("limit" = Option<u64>, Query), ("cursor" = Option<String>, Query)),
    responses((status = 200, body = StudyList, headers(("Link" = String))), (status = 422, body = Problem)))]
pub async fn list(
    State(application): State<Application>,
    Query(query): Query<Vec<(String, String)>>,
) -> Result<Response, ApiError> {
    let page = Page::of(&query, &[])?;
    let (cursor, limit) = (page.cursor.clone(), page.limit + 1);
    let rows = with_store(&application, move |store| Ok(store.studies(cursor.as_deref(), limit)?)).await?;
    Ok(page.answer(
        "/v1/studies",
        rows,
        |row| row.id.clone(),
        |items, next| StudyList { items: items.into_iter().map(StudyView::from).collect(), next },
    ))
}

async fn study(application: &Application, id: String) -> Result<StudyRow, ApiError> {
    with_store(application, move |store| store.study(&id)?.ok_or(ApiError::NotFound("study"))).await
}

/// A study: what it is, and its points by state.
#[utoipa::path(get, path = "/v1/studies/{id}", tag = "studies", params(("id" = String, Path)),
    responses((status = 200, body = StudyView), (status = 404, body = Problem)))]
pub async fn get(State(application): State<Application>, Path(id): Path<String>) -> Result<Json<StudyView>, ApiError> {
    Ok(Json(study(&application, id).await?.into()))
}

/// Deletes a study whose jobs have all ended, with those jobs and their files; never cancels.
#[utoipa::path(delete, path = "/v1/studies/{id}", tag = "studies", params(("id" = String, Path)),
    responses((status = 204), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn delete(State(application): State<Application>, Path(id): Path<String>) -> Result<StatusCode, ApiError> {
    let row = study(&application, id).await?;
    if with_store(&application, move |store| Ok(store.delete_study(&row.id)?)).await? {
        return Ok(StatusCode::NO_CONTENT);
    }
    Err(ApiError::Conflict("not all jobs of the study have ended; cancel it first".to_owned()))
}

/// A page of the jobs of a study, repeated ones included; filters and pages as for `GET /v1/jobs`.
#[utoipa::path(get, path = "/v1/studies/{id}/jobs", tag = "studies",
    params(("id" = String, Path), ("state" = Option<String>, Query), ("sort" = Option<String>, Query),
        ("limit" = Option<u64>, Query), ("cursor" = Option<String>, Query)),
    responses((status = 200, body = JobList, headers(("Link" = String))), (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn jobs_of(
    State(application): State<Application>,
    Path(id): Path<String>,
    Query(query): Query<Vec<(String, String)>>,
) -> Result<Response, ApiError> {
    let row = study(&application, id).await?;
    let path = format!("/v1/studies/{}/jobs", row.id);
    jobs::page(&application, &path, &query, Some(row.id)).await
}

/// The live table: a row a point, as CSV or as JSON by `Accept`; `after` and `limit` cut it into pages by index.
#[utoipa::path(get, path = "/v1/studies/{id}/table", tag = "studies",
    params(("id" = String, Path), ("after" = Option<u64>, Query), ("limit" = Option<u64>, Query), ("Accept" = Option<String>, Header)),
    responses((status = 200, content_type = "text/csv"), (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn table(
    State(application): State<Application>,
    Path(id): Path<String>,
    Query(query): Query<Vec<(String, String)>>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    refuse_unknown(&query, &["after", "limit"])?;
    let after = number(&query, "after")?;
    let limit = number(&query, "limit")?.unwrap_or(ALL_POINTS).clamp(1, ALL_POINTS);
    let row = study(&application, id).await?;
    let table = with_store(&application, move |store| {
        let points = store.points(&row, after, limit)?;
        Ok(study_table::compose(&row.axes, &points))
    })
    .await?;
    if accepts(&headers, "json", "text/csv") {
        return Ok(Json(table.to_json()).into_response());
    }
    Ok(([(header::CONTENT_TYPE, "text/csv")], table.to_csv()).into_response())
}

/// Errors over spacing and over time with fitted orders, as JSON, or as a picture (SVG) by `Accept`; `error` names the
/// quantity and norm of the picture, such as `phi.rms`.
#[utoipa::path(get, path = "/v1/studies/{id}/report", tag = "studies",
    params(("id" = String, Path), ("error" = Option<String>, Query), ("Accept" = Option<String>, Header)),
    responses((status = 200, content_type = "application/json"), (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn report(
    State(application): State<Application>,
    Path(id): Path<String>,
    Query(query): Query<Vec<(String, String)>>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    refuse_unknown(&query, &["error"])?;
    let wanted = query.iter().find(|(name, _)| name == "error").map(|(_, value)| value.clone());
    let row = study(&application, id).await?;
    let is_picture = accepts(&headers, "svg", "json");
    with_store(&application, move |store| {
        let points = store.points(&row, None, ALL_POINTS)?;
        if !is_picture {
            return Ok(Json(study_report::compose(&row, &points)).into_response());
        }
        let picture = study_report::draw(&row, &points, wanted.as_deref()).map_err(ApiError::Internal)?;
        let picture = picture.ok_or(ApiError::NotFound("error among the finished points"))?;
        Ok(([(header::CONTENT_TYPE, "image/svg+xml")], picture).into_response())
    })
    .await
}

async fn request(
    application: &Application,
    id: String,
    trigger: Trigger,
    reason: Option<Reason>,
) -> Result<Response, ApiError> {
    let row = study(application, id).await?;
    let row = with_store(application, move |store| {
        store.change_study(&row.id, trigger, &Change { reason, ..Change::default() })?;
        store.study(&row.id)?.ok_or(ApiError::NotFound("study"))
    })
    .await?;
    application.supervisor.wake();
    Ok((StatusCode::ACCEPTED, Json(StudyView::from(row))).into_response())
}

/// Cancels every job of a study that has not ended. Idempotent.
#[utoipa::path(post, path = "/v1/studies/{id}/cancel", tag = "studies", params(("id" = String, Path)),
    responses((status = 202, body = StudyView), (status = 404, body = Problem)))]
pub async fn cancel(State(application): State<Application>, Path(id): Path<String>) -> Result<Response, ApiError> {
    request(&application, id, Trigger::Cancel, Some(Reason::UserCancel)).await
}

/// Pauses every job of a study that waits or runs. Idempotent.
#[utoipa::path(post, path = "/v1/studies/{id}/pause", tag = "studies", params(("id" = String, Path)),
    responses((status = 202, body = StudyView), (status = 404, body = Problem)))]
pub async fn pause(State(application): State<Application>, Path(id): Path<String>) -> Result<Response, ApiError> {
    request(&application, id, Trigger::Pause, Some(Reason::UserPause)).await
}

/// Puts every paused job of a study back into the queue. Idempotent.
#[utoipa::path(post, path = "/v1/studies/{id}/resume", tag = "studies", params(("id" = String, Path)),
    responses((status = 202, body = StudyView), (status = 404, body = Problem)))]
pub async fn resume(State(application): State<Application>, Path(id): Path<String>) -> Result<Response, ApiError> {
    request(&application, id, Trigger::Resume, None).await
}

/// Makes new jobs for points that failed, and for those that a stop at a failure canceled. Idempotent: a point whose
/// repetition has not failed is left alone.
#[utoipa::path(post, path = "/v1/studies/{id}/retry", tag = "studies",
    params(("id" = String, Path), ("Idempotency-Key" = Option<String>, Header)),
    responses((status = 202, body = StudyView), (status = 404, body = Problem), (status = 422, body = Problem),
        (status = 429, body = Problem), (status = 507, body = Problem)))]
pub async fn retry(
    State(application): State<Application>,
    Path(id): Path<String>,
    request: Request,
) -> Result<Response, ApiError> {
    let row = study(&application, id).await?;
    let mut creation = Creation::take(&application, request, BODY_LIMIT).await?;
    let here = application.clone();
    let response = with_store(&application, move |store| {
        if let Some(made) = creation.known.take() {
            return creation.answer(made);
        }
        let sources = StoreSources::new(store);
        let calibration = store.calibration()?;
        let mut new = Vec::new();
        for point in store.points(&row, None, ALL_POINTS)? {
            let was_stopped = row.is_stopping && point.state == JobState::Canceled;
            if point.state != JobState::Failed && !was_stopped {
                continue;
            }
            let Some(old) = store.job(&point.job)? else { continue };
            let body = sources.understand(&old.spec, here.config.allowance(), &calibration)?;
            let mut job = NewJob::of(&body);
            job.study = Some((row.id.clone(), point.index));
            job.retry_of = Some(point.job);
            new.push(job);
        }
        jobs::check_room(&here, store, new.len() as u64, new.iter().map(|job| job.disk_bytes).sum())?;
        let answer = |row: &StudyRow| kept(StatusCode::ACCEPTED, None, &StudyView::from(row.clone()));
        let made: Made = store.retry_study(&row.id, &new, creation.once.as_ref(), answer)?;
        creation.answer(made)
    })
    .await?;
    application.supervisor.wake();
    Ok(response)
}
