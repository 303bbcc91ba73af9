//! Studies: sweeps of jobs as one object.

use crate::accept;
use crate::access::Client;
use crate::base_path::address;
use crate::creation::{Creation, check_capacity};
use crate::error::{ApiError, Problem};
use crate::idempotency::stored_response;
use crate::pagination::PageQuery;
use crate::path::Path;
use crate::query::QueryParameters;
use crate::resource::{self, Deletion, Resource};
use crate::routes::jobs::{self, JobQuery};
use crate::state::AppState;
use crate::store_sources::StoreSources;
use crate::views::{DryRunView, JobList, StudyList, StudyView};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use meniscus_jobs::service::store::{Change, NewJob, NewStudy, Store, StoreError, StudyRow};
use meniscus_jobs::service::{refinement, study_report, study_table};
use meniscus_jobs::spec::states::{Reason, State as JobState, Trigger};
use meniscus_jobs::spec::study;
use serde::Deserialize;

/// Largest body of a study in bytes: room for a list of ten thousand points.
pub const BODY_LIMIT: usize = 16 << 20;
/// Default number of rows of a table: all.
const ALL_POINTS: u64 = study::MOST_POINTS as u64;

/// How to submit a study.
#[derive(Debug, Clone, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct SubmitQuery {
    /// Create nothing; answer the points and the estimate of all.
    #[serde(default)]
    #[param(value_type = Option<bool>)]
    dry_run: bool,
}

/// Creates a study with all its jobs. If anything is wrong, nothing is created and all errors are listed.
#[utoipa::path(post, path = "/v1/studies", operation_id = "submit_study", tag = "studies",
    params(SubmitQuery, ("Idempotency-Key" = Option<String>, Header)),
    request_body(content = Object, description = "a study"),
    responses((status = 201, body = StudyView, headers(("Location" = String))), (status = 200, body = DryRunView, description = "a dry run"),
        (status = 400, body = Problem), (status = 413, body = Problem), (status = 422, body = Problem), (status = 429, body = Problem),
        (status = 503, body = Problem), (status = 507, body = Problem)))]
pub async fn submit(
    State(state): State<AppState>,
    QueryParameters(query): QueryParameters<SubmitQuery>,
    request: Request,
) -> Result<Response, ApiError> {
    let mut creation = Creation::receive(&state, request, BODY_LIMIT).await?;
    let here = state.clone();
    let work = move |store: &Store| {
        let spec = creation.json()?;
        if let Some(made) = creation.known.take() {
            return creation.respond(made);
        }
        let (allowance, slots) = (here.config.allowance(), here.config.slots);
        let study = study::parse(&spec, allowance, slots, store, &store.calibration()?, NewJob::from_body)?;
        if query.dry_run {
            let view = DryRunView { points: study.points, estimate: serde_json::json!(study.forecast) };
            return Ok(Json(view).into_response());
        }
        check_capacity(&here, store, study.jobs.len() as u64, study.total.disk_bytes)?;
        let answer = |row: &StudyRow| {
            let location = address(&format!("/v1/studies/{}", row.id));
            stored_response(StatusCode::CREATED, Some(location), &StudyView::from(row.clone()))
        };
        let study = NewStudy { owner: creation.owner.clone(), ..study.into() };
        creation.respond(store.make_study(study, creation.keyed.as_ref(), answer)?)
    };
    let response = state.with_store(work).await?;
    state.supervisor.wake();
    Ok(response)
}

impl Resource for StudyRow {
    const NOUN: &'static str = "study";
    /// The states of all jobs are counted.
    const IS_ONE_ROW: bool = false;
    type View = StudyView;

    fn id(&self) -> &str {
        &self.id
    }

    fn find(store: &Store, id: &str) -> Result<Option<Self>, StoreError> {
        store.study(id)
    }

    fn owner(&self, _: &Store) -> Result<Option<String>, StoreError> {
        Ok(self.owner.clone())
    }

    fn delete(&self, store: &Store) -> Result<Deletion, StoreError> {
        if store.delete_study(&self.id)? {
            return Ok(Deletion::Done);
        }
        Ok(Deletion::Refused("Some jobs of the study have not ended. Cancel the study first.".to_owned()))
    }
}

/// A page of studies, newest first. New studies never shift pages.
#[utoipa::path(get, path = "/v1/studies", operation_id = "list_studies", tag = "studies", params(PageQuery),
    responses((status = 200, body = StudyList, headers(("Link" = String))), (status = 422, body = Problem)))]
pub async fn list(
    State(state): State<AppState>,
    uri: Uri,
    QueryParameters(query): QueryParameters<PageQuery>,
) -> Result<Response, ApiError> {
    let read = move |store: &Store, limit| store.studies(query.cursor.as_ref().map(|cursor| cursor.0.as_str()), limit);
    resource::page::<StudyRow, StudyList>(&state, &uri, query.limit, read).await
}

/// A study: its body, and its points by state.
#[utoipa::path(get, path = "/v1/studies/{id}", operation_id = "get_study", tag = "studies", params(("id" = String, Path)),
    responses((status = 200, body = StudyView), (status = 404, body = Problem)))]
pub async fn get(State(state): State<AppState>, Path(id): Path<String>) -> Result<Json<StudyView>, ApiError> {
    resource::get::<StudyRow>(&state, id).await
}

/// Deletes a study whose jobs have all ended, with those jobs and their files. Never cancels.
#[utoipa::path(delete, path = "/v1/studies/{id}", operation_id = "delete_study", tag = "studies", params(("id" = String, Path)),
    responses((status = 204), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn delete(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
) -> Result<StatusCode, ApiError> {
    resource::delete::<StudyRow>(&state, &client, id).await
}

/// A page of the jobs of a study, including repeated ones. Filters and pages are those of `GET /v1/jobs`.
#[utoipa::path(get, path = "/v1/studies/{id}/jobs", operation_id = "study_jobs", tag = "studies", params(("id" = String, Path), JobQuery),
    responses((status = 200, body = JobList, headers(("Link" = String))), (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn jobs_of(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
    uri: Uri,
    QueryParameters(query): QueryParameters<JobQuery>,
) -> Result<Response, ApiError> {
    let row = resource::find::<StudyRow>(&state, id).await?;
    jobs::page(&state, &client, &uri, query.with_study(&row.id)).await
}

/// Which rows of a table.
#[derive(Debug, Clone, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct TableQuery {
    /// Index of the point before the first row; the table begins with the first point by default.
    after: Option<u64>,
    /// Rows; all by default.
    limit: Option<u64>,
}

/// A table with one row for each point, as CSV or as JSON by `Accept`. It is current at any time.
#[utoipa::path(get, path = "/v1/studies/{id}/table", operation_id = "study_table", tag = "studies",
    params(("id" = String, Path), TableQuery, ("Accept" = Option<String>, Header)),
    responses((status = 200, content_type = "text/csv"), (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn table(
    State(state): State<AppState>,
    Path(id): Path<String>,
    QueryParameters(query): QueryParameters<TableQuery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let limit = query.limit.unwrap_or(ALL_POINTS).clamp(1, ALL_POINTS);
    let row = resource::find::<StudyRow>(&state, id).await?;
    let compose = move |store: &Store| {
        let points = store.points(&row, query.after, limit)?;
        Ok::<_, ApiError>(study_table::compose(&row.axes, &points))
    };
    let table = state.with_store(compose).await?;
    if accept::prefers(&headers, "json", "text/csv") {
        return Ok(Json(table.to_json()).into_response());
    }
    Ok(([(header::CONTENT_TYPE, "text/csv")], table.to_csv()).into_response())
}

/// What a picture shows.
#[derive(Debug, Clone, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct ReportQuery {
    /// Quantity and norm of the picture, such as `phi.rms`; the first error of the report by default. A study that refines then
    /// answers as a sweep does.
    error: Option<String>,
}

/// Errors over spacing and over time with fitted orders, as JSON, or as a picture (SVG) by `Accept`. Of a study that refines:
/// levels, observed order, extrapolated value, grid convergence index, and what would meet the tolerance.
#[utoipa::path(get, path = "/v1/studies/{id}/report", operation_id = "study_report", tag = "studies",
    params(("id" = String, Path), ReportQuery, ("Accept" = Option<String>, Header)),
    responses((status = 200, content_type = "application/json"), (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn report(
    State(state): State<AppState>,
    Path(id): Path<String>,
    QueryParameters(query): QueryParameters<ReportQuery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let row = resource::find::<StudyRow>(&state, id).await?;
    let is_picture = accept::prefers(&headers, "svg", "json");
    let compose = move |store: &Store| {
        if row.refinement.is_some() && query.error.is_none() {
            return refinement(store, &row, is_picture);
        }
        let points = store.points(&row, None, ALL_POINTS)?;
        if !is_picture {
            return Ok(Json(study_report::compose(&row, &points)).into_response());
        }
        let picture = study_report::draw(&row, &points, query.error.as_deref()).map_err(ApiError::Internal)?;
        let picture = picture.ok_or(ApiError::NotFound("error of a finished point with this name"))?;
        Ok(([(header::CONTENT_TYPE, "image/svg+xml")], picture).into_response())
    };
    state.with_store(compose).await
}

/// The report of a study that refines.
fn refinement(store: &Store, study: &StudyRow, is_picture: bool) -> Result<Response, ApiError> {
    if !is_picture {
        let report = refinement::report::compose(store, study)?;
        return Ok(Json(report.ok_or(ApiError::NotFound("report of the study"))?).into_response());
    }
    let picture = refinement::report::draw(store, study)?.ok_or(ApiError::NotFound("level with an error"))?;
    let picture = picture.map_err(ApiError::Internal)?;
    Ok(([(header::CONTENT_TYPE, "image/svg+xml")], picture).into_response())
}

/// Applies a trigger to all jobs of a study that it concerns.
async fn request(
    state: &AppState,
    client: &Client,
    id: String,
    trigger: Trigger,
    reason: Option<Reason>,
) -> Result<Response, ApiError> {
    let row = resource::find_own::<StudyRow>(state, client, id).await?;
    let work = move |store: &Store| {
        store.change_study(&row.id, trigger, &Change { reason, ..Change::default() })?;
        store.study(&row.id)?.ok_or(ApiError::NotFound("study"))
    };
    let row = state.with_store(work).await?;
    state.supervisor.wake();
    Ok((StatusCode::ACCEPTED, Json(StudyView::from(row))).into_response())
}

/// Cancels every job of a study that has not ended. Repeating the request changes nothing.
#[utoipa::path(post, path = "/v1/studies/{id}/cancel", operation_id = "cancel_study", tag = "studies", params(("id" = String, Path)),
    responses((status = 202, body = StudyView), (status = 404, body = Problem)))]
pub async fn cancel(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
) -> Result<Response, ApiError> {
    request(&state, &client, id, Trigger::Cancel, Some(Reason::UserCancel)).await
}

/// Pauses every queued or running job of a study. Repeating the request changes nothing.
#[utoipa::path(post, path = "/v1/studies/{id}/pause", operation_id = "pause_study", tag = "studies", params(("id" = String, Path)),
    responses((status = 202, body = StudyView), (status = 404, body = Problem)))]
pub async fn pause(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
) -> Result<Response, ApiError> {
    request(&state, &client, id, Trigger::Pause, Some(Reason::UserPause)).await
}

/// Returns every paused job of a study to the queue. Repeating the request changes nothing.
#[utoipa::path(post, path = "/v1/studies/{id}/resume", operation_id = "resume_study", tag = "studies", params(("id" = String, Path)),
    responses((status = 202, body = StudyView), (status = 404, body = Problem)))]
pub async fn resume(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
) -> Result<Response, ApiError> {
    request(&state, &client, id, Trigger::Resume, None).await
}

/// Creates new jobs for points that failed, and for points that were canceled because another point failed. A point whose
/// new job has not failed is left as it is.
#[utoipa::path(post, path = "/v1/studies/{id}/retry", operation_id = "retry_study", tag = "studies",
    params(("id" = String, Path), ("Idempotency-Key" = Option<String>, Header)),
    responses((status = 202, body = StudyView), (status = 404, body = Problem), (status = 422, body = Problem),
        (status = 429, body = Problem), (status = 507, body = Problem)))]
pub async fn retry(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
    request: Request,
) -> Result<Response, ApiError> {
    let row = resource::find_own::<StudyRow>(&state, &client, id).await?;
    let mut creation = Creation::receive(&state, request, BODY_LIMIT).await?;
    let here = state.clone();
    let work = move |store: &Store| {
        if let Some(made) = creation.known.take() {
            return creation.respond(made);
        }
        let new = new_jobs(&here, store, &row)?;
        check_capacity(&here, store, new.len() as u64, new.iter().map(|job| job.disk_bytes).sum())?;
        let answer = |row: &StudyRow| stored_response(StatusCode::ACCEPTED, None, &StudyView::from(row.clone()));
        creation.respond(store.retry_study(&row.id, &new, creation.keyed.as_ref(), answer)?)
    };
    let response = state.with_store(work).await?;
    state.supervisor.wake();
    Ok(response)
}

/// Jobs that repeat the points of a study that failed, or were canceled because another point failed.
fn new_jobs(state: &AppState, store: &Store, study: &StudyRow) -> Result<Vec<NewJob>, ApiError> {
    let sources = StoreSources::new(store);
    let calibration = store.calibration()?;
    let mut new = Vec::new();
    if study.refinement.is_some() {
        // Its levels are made again one after another, by the supervisor.
        return Ok(new);
    }
    for point in store.points(study, None, ALL_POINTS)? {
        let was_stopped = study.is_stopping && point.state == JobState::Canceled;
        if point.state != JobState::Failed && !was_stopped {
            continue;
        }
        let Some(old) = store.job(&point.job)? else { continue };
        let body = sources.resolve(&old.spec, state.config.allowance(), &calibration)?;
        let mut job = NewJob::from_body(&body);
        job.study = Some((study.id.clone(), point.index));
        job.retry_of = Some(point.job);
        job.owner.clone_from(&study.owner);
        new.push(job);
    }
    Ok(new)
}
