//! The published files of a job.

use crate::application::Application;
use crate::error::{ApiError, Problem};
use crate::file_response::{FileFacts, bytes_response, file_response};
use crate::routes::{job, with_store};
use crate::views::{FileList, FileView};
use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::{Path, State};
use axum::http::{HeaderMap, header};
use axum::response::Response;
use meniscus_jobs::service::store::FileRow;
use meniscus_jobs::spec::attempt_spec::attempt_directory;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

/// All published files.
#[utoipa::path(get, path = "/v1/jobs/{id}/files", tag = "files", params(("id" = String, Path)),
    responses((status = 200, body = FileList), (status = 404, body = Problem)))]
pub async fn list(State(application): State<Application>, Path(id): Path<String>) -> Result<Json<FileList>, ApiError> {
    let row = job(&application, &id).await?;
    let files = with_store(&application, move |store| Ok(store.files(&row.id)?)).await?;
    Ok(Json(FileList { items: files.into_iter().map(FileView::from).collect(), next: None }))
}

/// A published file of a job as an answer.
pub(super) async fn answer(
    application: &Application,
    id: &str,
    path: &str,
    headers: &HeaderMap,
) -> Result<Response, ApiError> {
    let row = job(application, id).await?;
    let wanted = path.to_owned();
    // Only what is listed exists, so no path can lead elsewhere.
    let file = with_store(application, move |store| Ok(store.file(&row.id, &wanted)?)).await?;
    let file = file.ok_or(ApiError::NotFound("file"))?;
    let name = path.rsplit('/').next().unwrap_or("file").to_owned();
    let facts = FileFacts { sha256: Some(file.sha256.clone()), media_type: file.media_type.clone(), name };
    match &file.content {
        Some(content) => bytes_response(content.as_bytes(), &facts, headers),
        None => file_response(&location(application, id, &file), &facts, headers).await,
    }
}

fn location(application: &Application, job: &str, file: &FileRow) -> PathBuf {
    attempt_directory(&application.store.job_directory(job), file.attempt).join(&file.path)
}

/// A file, or a part of it. The tag is its SHA-256.
#[utoipa::path(get, path = "/v1/jobs/{id}/files/{*path}", tag = "files",
    params(("id" = String, Path), ("path" = String, Path, description = "a path of the list"),
        ("Range" = Option<String>, Header), ("If-Range" = Option<String>, Header), ("If-None-Match" = Option<String>, Header)),
    responses((status = 200, content_type = "application/octet-stream"), (status = 206), (status = 304),
        (status = 404, body = Problem), (status = 416, body = Problem)))]
pub async fn get(
    State(application): State<Application>,
    Path((id, path)): Path<(String, String)>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    answer(&application, &id, &path, &headers).await
}

/// All published files as one stream.
#[utoipa::path(get, path = "/v1/jobs/{id}/files.tar", tag = "files", params(("id" = String, Path)),
    responses((status = 200, content_type = "application/x-tar"), (status = 404, body = Problem)))]
pub async fn tar(State(application): State<Application>, Path(id): Path<String>) -> Result<Response, ApiError> {
    let row = job(&application, &id).await?;
    let files = with_store(&application, move |store| Ok(store.files(&row.id)?)).await?;
    let places: Vec<(FileRow, PathBuf)> =
        files.into_iter().map(|f| (f.clone(), location(&application, &id, &f))).collect();
    // A reader that is slow holds up a thread; there are so many for archives and no more.
    let permit = Arc::clone(&application.archives).try_acquire_owned().map_err(|_| ApiError::Busy)?;
    let (sender, receiver) = mpsc::channel::<Result<Bytes, io::Error>>(8);
    let top = id.clone();
    tokio::task::spawn_blocking(move || {
        let _permit = permit;
        let mut archive = ::tar::Builder::new(ChannelWriter(sender.clone()));
        archive.mode(::tar::HeaderMode::Deterministic);
        let written = places
            .iter()
            .try_for_each(|(file, place)| append(&mut archive, &format!("{top}/{}", file.path), file, place))
            .and_then(|()| archive.finish());
        if let Err(error) = written {
            // An archive that ends early must not look whole.
            let _ = sender.blocking_send(Err(error));
        }
    });
    Response::builder()
        .header(header::CONTENT_TYPE, "application/x-tar")
        .header(header::CONTENT_DISPOSITION, format!("attachment; filename=\"{id}.tar\""))
        .body(Body::from_stream(ReceiverStream::new(receiver)))
        .map_err(|error| ApiError::Internal(error.to_string()))
}

fn append<W: Write>(
    archive: &mut ::tar::Builder<W>,
    name: &str,
    file: &FileRow,
    place: &std::path::Path,
) -> io::Result<()> {
    let Some(content) = &file.content else { return archive.append_path_with_name(place, name) };
    let mut header = ::tar::Header::new_gnu();
    header.set_size(content.len() as u64);
    header.set_mode(0o644);
    archive.append_data(&mut header, name, content.as_bytes())
}

struct ChannelWriter(mpsc::Sender<Result<Bytes, io::Error>>);

impl Write for ChannelWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let sent = self.0.blocking_send(Ok(Bytes::copy_from_slice(bytes)));
        sent.map(|()| bytes.len()).map_err(|_| io::Error::from(io::ErrorKind::BrokenPipe))
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
