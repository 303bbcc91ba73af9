//! The published files of a job.

use crate::archive::{self, Content, Entry};
use crate::error::{ApiError, Problem};
use crate::file_response::{FileFacts, bytes_response, file_response};
use crate::path::Path;
use crate::resource;
use crate::state::AppState;
use crate::views::{FileList, FileView};
use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, header};
use axum::response::Response;
use meniscus_jobs::service::store::{FileRow, JobRow, Store};
use meniscus_jobs::spec::attempt_files::attempt_directory;
use std::path::PathBuf;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

/// All published files of a job.
#[utoipa::path(get, path = "/v1/jobs/{id}/files", operation_id = "list_files", tag = "files", params(("id" = String, Path)),
    responses((status = 200, body = FileList), (status = 404, body = Problem)))]
pub async fn list(State(state): State<AppState>, Path(id): Path<String>) -> Result<Json<FileList>, ApiError> {
    let views = files_of(&state, &id).await?.into_iter().map(FileView::from).collect();
    Ok(Json(FileList::from((views, None))))
}

/// All published files of a job in the order of their paths.
async fn files_of(state: &AppState, id: &str) -> Result<Vec<FileRow>, ApiError> {
    let job = resource::find::<JobRow>(state, id.to_owned()).await?;
    state.with_store(move |store| Ok(store.files(&job.id)?)).await
}

/// A published file of a job as an answer.
pub(super) async fn answer(state: &AppState, id: &str, path: &str, headers: &HeaderMap) -> Result<Response, ApiError> {
    let job = resource::find::<JobRow>(state, id.to_owned()).await?;
    let wanted = path.to_owned();
    // Only listed files are served, so no path can lead out of the job's directory.
    let find = move |store: &Store| store.file(&job.id, &wanted)?.ok_or(ApiError::NotFound("file"));
    let file = state.with_store(find).await?;
    let name = path.rsplit('/').next().unwrap_or("file").to_owned();
    let facts = FileFacts { sha256: Some(file.sha256.clone()), media_type: file.media_type.clone(), name };
    match &file.content {
        Some(content) => bytes_response(content.as_bytes(), &facts, headers),
        None => file_response(&location(state, id, &file), &facts, headers).await,
    }
}

fn location(state: &AppState, job: &str, file: &FileRow) -> PathBuf {
    attempt_directory(&state.store.job_directory(job), file.attempt).join(&file.path)
}

/// A file, or a part of it. The entity tag is its SHA-256.
#[utoipa::path(get, path = "/v1/jobs/{id}/files/{*path}", operation_id = "download_file", tag = "files",
    params(("id" = String, Path), ("path" = String, Path, description = "a path of the list"),
        ("Range" = Option<String>, Header), ("If-Range" = Option<String>, Header), ("If-None-Match" = Option<String>, Header)),
    responses((status = 200, content_type = "application/octet-stream"), (status = 206), (status = 304),
        (status = 404, body = Problem), (status = 416, body = Problem)))]
pub async fn get(
    State(state): State<AppState>,
    Path((id, path)): Path<(String, String)>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    answer(&state, &id, &path, &headers).await
}

/// All published files of a job as one archive.
#[utoipa::path(get, path = "/v1/jobs/{id}/files.tar", operation_id = "download_all_files", tag = "files", params(("id" = String, Path)),
    responses((status = 200, content_type = "application/x-tar"), (status = 404, body = Problem)))]
pub async fn tar(State(state): State<AppState>, Path(id): Path<String>) -> Result<Response, ApiError> {
    let files = files_of(&state, &id).await?;
    let entry = |file: FileRow| Entry {
        name: format!("{id}/{}", file.path),
        content: match &file.content {
            Some(text) => Content::Text(text.clone()),
            None => Content::File(location(&state, &id, &file)),
        },
    };
    let entries = files.into_iter().map(entry).collect();
    let (sender, receiver) = mpsc::channel(8);
    tokio::spawn(archive::send(entries, sender));
    Response::builder()
        .header(header::CONTENT_TYPE, "application/x-tar")
        .header(header::CONTENT_DISPOSITION, format!("attachment; filename=\"{id}.tar\""))
        .body(Body::from_stream(ReceiverStream::new(receiver)))
        .map_err(|error| ApiError::Internal(error.to_string()))
}
