//! Checkpoints of jobs.

use crate::application::Application;
use crate::error::{ApiError, Problem};
use crate::file_response::{FileFacts, file_response};
use crate::routes::{job, with_store};
use crate::views::{CheckpointList, CheckpointView, JobView};
use axum::Json;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Redirect, Response};
use meniscus_jobs::service::store::CheckpointRow;
use meniscus_jobs::spec::attempt_spec::attempt_directory;
use meniscus_jobs::spec::states::State as JobState;
use meniscus_jobs::worker::observers::frames::HDF5;

/// A job's verified checkpoints, newest first.
#[utoipa::path(get, path = "/v1/jobs/{id}/checkpoints", tag = "checkpoints", params(("id" = String, Path)),
    responses((status = 200, body = CheckpointList), (status = 404, body = Problem)))]
pub async fn list(
    State(application): State<Application>,
    Path(id): Path<String>,
) -> Result<Json<CheckpointList>, ApiError> {
    let row = job(&application, &id).await?;
    let rows = with_store(&application, move |store| Ok(store.checkpoints(&row.id)?)).await?;
    Ok(Json(CheckpointList { items: rows.into_iter().map(CheckpointView::from).collect(), next: None }))
}

/// Asks for a checkpoint at the end of the running step.
#[utoipa::path(post, path = "/v1/jobs/{id}/checkpoints", tag = "checkpoints", params(("id" = String, Path)),
    responses((status = 202, body = JobView), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn request(State(application): State<Application>, Path(id): Path<String>) -> Result<Response, ApiError> {
    let row = job(&application, &id).await?;
    if row.state != JobState::Running {
        return Err(ApiError::Conflict(format!("a job that is {} writes no checkpoints", row.state.word())));
    }
    application.supervisor.checkpoint(&row.id);
    Ok((StatusCode::ACCEPTED, Json(JobView::from(row))).into_response())
}

/// The content of the newest checkpoint, by redirection.
#[utoipa::path(get, path = "/v1/jobs/{id}/checkpoints/latest/content", tag = "checkpoints", params(("id" = String, Path)),
    responses((status = 307), (status = 404, body = Problem)))]
pub async fn latest(State(application): State<Application>, Path(id): Path<String>) -> Result<Redirect, ApiError> {
    let row = job(&application, &id).await?;
    let rows = with_store(&application, move |store| Ok(store.checkpoints(&row.id)?)).await?;
    let newest = rows.first().ok_or(ApiError::NotFound("checkpoint"))?;
    Ok(Redirect::temporary(&format!("/v1/checkpoints/{}/content", newest.id)))
}

async fn checkpoint(application: &Application, id: String) -> Result<CheckpointRow, ApiError> {
    with_store(application, move |store| store.checkpoint(&id)?.ok_or(ApiError::NotFound("checkpoint"))).await
}

/// One checkpoint.
#[utoipa::path(get, path = "/v1/checkpoints/{id}", tag = "checkpoints", params(("id" = String, Path)),
    responses((status = 200, body = CheckpointView), (status = 404, body = Problem)))]
pub async fn get(
    State(application): State<Application>,
    Path(id): Path<String>,
) -> Result<Json<CheckpointView>, ApiError> {
    Ok(Json(checkpoint(&application, id).await?.into()))
}

/// Deletes a checkpoint of a job at its end. While the job may still need it, 409.
#[utoipa::path(delete, path = "/v1/checkpoints/{id}", tag = "checkpoints", params(("id" = String, Path)),
    responses((status = 204), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn delete(State(application): State<Application>, Path(id): Path<String>) -> Result<StatusCode, ApiError> {
    let row = checkpoint(&application, id).await?;
    let owner = job(&application, &row.job).await?;
    if !owner.state.is_terminal() {
        return Err(ApiError::Conflict(format!(
            "the job that wrote it is {} and may go on from it",
            owner.state.word()
        )));
    }
    // A download that is under way keeps its file open and comes to its end.
    if with_store(&application, move |store| Ok(store.delete_checkpoint(&row)?)).await? {
        return Ok(StatusCode::NO_CONTENT);
    }
    Err(ApiError::Conflict("a restart from it has not ended".to_owned()))
}

/// The file of a checkpoint, or a part of it.
#[utoipa::path(get, path = "/v1/checkpoints/{id}/content", tag = "checkpoints",
    params(("id" = String, Path), ("Range" = Option<String>, Header)),
    responses((status = 200, content_type = "application/x-hdf5"), (status = 206), (status = 304),
        (status = 404, body = Problem), (status = 416, body = Problem)))]
pub async fn content(
    State(application): State<Application>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let row = checkpoint(&application, id).await?;
    let facts = FileFacts { sha256: Some(row.sha256), media_type: HDF5.to_owned(), name: format!("{}.h5", row.id) };
    let place = attempt_directory(&application.store.job_directory(&row.job), row.attempt).join(&row.path);
    file_response(&place, &facts, &headers).await
}
