//! Checkpoints of jobs.

use crate::access::Client;
use crate::base_path::address;
use crate::error::{ApiError, Problem};
use crate::file_response::{FileFacts, file_response};
use crate::path::Path;
use crate::resource::{self, Deletion, Resource};
use crate::state::AppState;
use crate::views::{CheckpointList, CheckpointView, JobView};
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Redirect, Response};
use axum::{Extension, Json};
use meniscus_jobs::service::store::{CheckpointRow, JobRow, Store, StoreError};
use meniscus_jobs::spec::attempt_files::HDF5_MEDIA_TYPE;
use meniscus_jobs::spec::attempt_files::attempt_directory;
use meniscus_jobs::spec::states::State as JobState;

/// Verified checkpoints of a job, newest first.
#[utoipa::path(get, path = "/v1/jobs/{id}/checkpoints", operation_id = "list_checkpoints", tag = "checkpoints", params(("id" = String, Path)),
    responses((status = 200, body = CheckpointList), (status = 404, body = Problem)))]
pub async fn list(State(state): State<AppState>, Path(id): Path<String>) -> Result<Json<CheckpointList>, ApiError> {
    let views = checkpoints_of(&state, id).await?.into_iter().map(CheckpointView::from).collect();
    Ok(Json(CheckpointList::from((views, None))))
}

/// Requests a checkpoint at the end of the current step.
#[utoipa::path(post, path = "/v1/jobs/{id}/checkpoints", operation_id = "request_checkpoint", tag = "checkpoints", params(("id" = String, Path)),
    responses((status = 202, body = JobView), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn request(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
) -> Result<Response, ApiError> {
    let row = resource::find_own::<JobRow>(&state, &client, id).await?;
    if row.state != JobState::Running {
        let why = format!("The job is {}. Only running jobs write checkpoints.", row.state.word());
        return Err(ApiError::Conflict(why));
    }
    state.supervisor.checkpoint(&row.id);
    Ok((StatusCode::ACCEPTED, Json(JobView::from(row))).into_response())
}

/// Redirects to the content of the newest checkpoint.
#[utoipa::path(get, path = "/v1/jobs/{id}/checkpoints/latest/content", operation_id = "latest_checkpoint", tag = "checkpoints", params(("id" = String, Path)),
    responses((status = 307), (status = 404, body = Problem)))]
pub async fn latest(State(state): State<AppState>, Path(id): Path<String>) -> Result<Redirect, ApiError> {
    let rows = checkpoints_of(&state, id).await?;
    let newest = rows.first().ok_or(ApiError::NotFound("checkpoint"))?;
    Ok(Redirect::temporary(&address(&format!("/v1/checkpoints/{}/content", newest.id))))
}

/// The checkpoints of a job, newest first.
async fn checkpoints_of(state: &AppState, id: String) -> Result<Vec<CheckpointRow>, ApiError> {
    let job = resource::find::<JobRow>(state, id).await?;
    state.with_store(move |store| Ok(store.checkpoints(&job.id)?)).await
}

impl Resource for CheckpointRow {
    const NOUN: &'static str = "checkpoint";
    const IS_ONE_ROW: bool = true;
    type View = CheckpointView;

    fn id(&self) -> &str {
        &self.id
    }

    fn find(store: &Store, id: &str) -> Result<Option<Self>, StoreError> {
        store.checkpoint(id)
    }

    fn owner(&self, store: &Store) -> Result<Option<String>, StoreError> {
        Ok(store.job(&self.job)?.and_then(|job| job.owner))
    }

    /// A download that is in progress keeps its file open and completes.
    fn delete(&self, store: &Store) -> Result<Deletion, StoreError> {
        if let Some(job) = store.job(&self.job)?.filter(|job| !job.state.is_terminal()) {
            let state = job.state.word();
            let why = format!("The job that wrote it is {state} and may continue from it. Cancel the job first.");
            return Ok(Deletion::Refused(why));
        }
        if store.delete_checkpoint(self)? {
            return Ok(Deletion::Done);
        }
        Ok(Deletion::Refused("An unfinished job restarts from it. Wait, or cancel that job first.".to_owned()))
    }
}

/// One checkpoint.
#[utoipa::path(get, path = "/v1/checkpoints/{id}", operation_id = "get_checkpoint", tag = "checkpoints", params(("id" = String, Path)),
    responses((status = 200, body = CheckpointView), (status = 404, body = Problem)))]
pub async fn get(State(state): State<AppState>, Path(id): Path<String>) -> Result<Json<CheckpointView>, ApiError> {
    resource::get::<CheckpointRow>(&state, id).await
}

/// Deletes a checkpoint of a job that has ended, unless an unfinished job restarts from it.
#[utoipa::path(delete, path = "/v1/checkpoints/{id}", operation_id = "delete_checkpoint", tag = "checkpoints", params(("id" = String, Path)),
    responses((status = 204), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn delete(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
) -> Result<StatusCode, ApiError> {
    resource::delete::<CheckpointRow>(&state, &client, id).await
}

/// The file of a checkpoint, or a part of it.
#[utoipa::path(get, path = "/v1/checkpoints/{id}/content", operation_id = "download_checkpoint", tag = "checkpoints",
    params(("id" = String, Path), ("Range" = Option<String>, Header)),
    responses((status = 200, content_type = "application/x-hdf5"), (status = 206), (status = 304),
        (status = 404, body = Problem), (status = 416, body = Problem)))]
pub async fn content(
    State(state): State<AppState>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let row = resource::find::<CheckpointRow>(&state, id).await?;
    let facts =
        FileFacts { sha256: Some(row.sha256), media_type: HDF5_MEDIA_TYPE.to_owned(), name: format!("{}.h5", row.id) };
    let place = attempt_directory(&state.store.job_directory(&row.job), row.attempt).join(&row.path);
    file_response(&place, &facts, &headers).await
}
