//! Uploads: checkpoints, points, surfaces and query points as files.

use crate::access::Client;
use crate::base_path::address;
use crate::creation::{free_bytes, spend};
use crate::error::{ApiError, Problem};
use crate::idempotency::{self, stored_response};
use crate::pagination::PageQuery;
use crate::path::Path as UrlPath;
use crate::query::QueryParameters;
use crate::request_body::announced_length;
use crate::resource::{self, Deletion, Resource};
use crate::state::AppState;
use crate::views::{UploadList, UploadView};
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::request::Parts;
use axum::http::{StatusCode, Uri, header};
use axum::response::Response;
use axum::{Extension, Json};
use meniscus_jobs::service::store::uploads::CONTENT;
use meniscus_jobs::service::store::{Made, NewUpload, Store, StoreError, UploadRow};
use meniscus_jobs::spec::uploads::Purpose;
use meniscus_jobs::system::artifacts;
use meniscus_jobs::system::digest;
use meniscus_jobs::system::process;
use serde::Deserialize;
use serde_json::Value;
use std::path::{Path, PathBuf};
use tokio::io::AsyncWriteExt;
use tokio_stream::StreamExt;

/// Longest name of an upload in characters; the rest is cut off.
const LONGEST_NAME: usize = 200;

/// What an upload is.
#[derive(Debug, Clone, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct UploadQuery {
    /// What the file is used as: `checkpoint`, `points`, `surface`, `queries`, `mesh`, `values` or `flow`.
    #[param(value_type = String)]
    r#as: Purpose,
    /// Name of the upload.
    name: Option<String>,
}

/// Receives a file. It is `quarantined` until a separate process has examined it, then `ready` or `rejected`.
#[utoipa::path(post, path = "/v1/uploads", operation_id = "submit_upload", tag = "uploads",
    params(UploadQuery, ("Idempotency-Key" = Option<String>, Header)),
    request_body(content = Vec<u8>, content_type = "application/octet-stream", description = "the file: HDF5; surfaces, meshes and queries also PLY, OBJ, STL or XYZ; values also text, CSV or .npy; flows also VTI"),
    responses((status = 201, body = UploadView, headers(("Location" = String))), (status = 413, body = Problem),
        (status = 415, body = Problem), (status = 422, body = Problem), (status = 429, body = Problem), (status = 507, body = Problem)))]
pub async fn submit(
    State(state): State<AppState>,
    QueryParameters(query): QueryParameters<UploadQuery>,
    request: Request,
) -> Result<Response, ApiError> {
    let (parts, body) = request.into_parts();
    refuse_forms(&parts)?;
    let client = parts.extensions.get::<Client>().cloned().unwrap_or_default();
    let budget = spend(&state, &client)?;
    let key = idempotency::key(&parts.headers)?;
    let allowance = allowance(&state, &parts)?;
    let (id, directory) = state.with_store(|store| Ok::<_, ApiError>(store.begin_upload()?)).await?;
    let path = directory.join(CONTENT);
    let mut unfinished = Unfinished { directory: Some(directory) };
    let size_bytes = receive(body, &path, &allowance).await?;
    unfinished.directory = None;
    let name = query.name.map(|name| name.chars().take(LONGEST_NAME).collect());
    let owner = client.owner();
    let work = move |store: &Store| -> Result<Made, ApiError> {
        let (sha256, _) = match artifacts::finish(&path).and_then(|()| digest::of_file(&path)) {
            Ok(found) => found,
            Err(error) => {
                store.abandon_upload(&id)?;
                return Err(error.into());
            }
        };
        let target = parts.uri.path_and_query().map_or("", |target| target.as_str());
        let keyed =
            key.map(|key| idempotency::keyed_request(client, key, &[b"POST", target.as_bytes(), sha256.as_bytes()]));
        let upload = NewUpload { id, purpose: query.r#as, name, size_bytes, sha256, owner };
        let answer = |row: &UploadRow| {
            let location = address(&format!("/v1/uploads/{}", row.id));
            stored_response(StatusCode::CREATED, Some(location), &UploadView::from(row.clone()))
        };
        Ok(store.make_upload(&upload, keyed.as_ref(), answer)?)
    };
    let made = state.with_store(work).await?;
    state.inspector.wake();
    idempotency::response(made, budget)
}

/// Refuses forms and JSON: an upload is the bytes of one file.
fn refuse_forms(parts: &Parts) -> Result<(), ApiError> {
    let media_type = parts.headers.get(header::CONTENT_TYPE).and_then(|v| v.to_str().ok()).unwrap_or_default();
    if media_type.starts_with("multipart/") || media_type.starts_with("application/json") {
        return Err(ApiError::UnsupportedMedia);
    }
    Ok(())
}

/// How much an upload may write. A file whose announced length is too large is refused before it is read.
fn allowance(state: &AppState, parts: &Parts) -> Result<Allowance, ApiError> {
    let (limit, reserve) = (state.config.upload_bytes, state.config.disk_reserve_bytes);
    let announced = announced_length(&parts.headers).unwrap_or(0);
    if announced > limit {
        return Err(ApiError::TooLarge(limit));
    }
    let free = free_bytes(state);
    if announced > free {
        return Err(ApiError::NoSpace { needed: announced, free });
    }
    Ok(Allowance { limit, free, reserve })
}

/// The directory of an unfinished upload. It is removed if the request ends early, for example because the client
/// disconnects.
struct Unfinished {
    directory: Option<PathBuf>,
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if let Some(directory) = &self.directory {
            // What cannot be removed now is named in the log of the next start.
            let _ = std::fs::remove_dir_all(directory);
        }
    }
}

/// Bytes of an upload between two checks of the free space.
const CHECK_BYTES: u64 = 16 << 20;

/// How much an upload may write, in bytes.
struct Allowance {
    /// Largest upload that the operator allows.
    limit: u64,
    /// Free space at the start, beyond the reserve.
    free: u64,
    /// Space that stays free.
    reserve: u64,
}

/// Writes a body into an unfinished file and returns its size in bytes.
async fn receive(body: Body, path: &Path, allowance: &Allowance) -> Result<u64, ApiError> {
    let mut file = tokio::fs::File::create(artifacts::unfinished(path)).await?;
    let mut stream = body.into_data_stream();
    let mut size = 0_u64;
    while let Some(bytes) = stream.next().await {
        let bytes = bytes.map_err(|error| ApiError::Unparsable(error.to_string()))?;
        size += bytes.len() as u64;
        if size > allowance.limit {
            return Err(ApiError::TooLarge(allowance.limit));
        }
        if size > allowance.free {
            return Err(ApiError::NoSpace { needed: size, free: allowance.free });
        }
        file.write_all(&bytes).await?;
        // Jobs and other uploads write at the same time, so less space may be free than at the start.
        if size / CHECK_BYTES != (size - bytes.len() as u64) / CHECK_BYTES {
            let left = process::free_space(path).unwrap_or(u64::MAX);
            if left < allowance.reserve {
                return Err(ApiError::NoSpace { needed: size, free: 0 });
            }
        }
    }
    file.flush().await?;
    if size == 0 {
        return Err(ApiError::invalid("", "required", "the file is empty", &Value::Null, Value::Null));
    }
    Ok(size)
}

impl Resource for UploadRow {
    const NOUN: &'static str = "upload";
    const IS_ONE_ROW: bool = true;
    type View = UploadView;

    fn id(&self) -> &str {
        &self.id
    }

    fn find(store: &Store, id: &str) -> Result<Option<Self>, StoreError> {
        store.upload(id)
    }

    fn owner(&self, _: &Store) -> Result<Option<String>, StoreError> {
        Ok(self.owner.clone())
    }

    fn delete(&self, store: &Store) -> Result<Deletion, StoreError> {
        if store.delete_upload(&self.id)? {
            return Ok(Deletion::Done);
        }
        let why = "The upload is being examined, or an unfinished job uses it. Wait, or cancel the job first.";
        Ok(Deletion::Refused(why.to_owned()))
    }
}

/// A page of uploads, newest first.
#[utoipa::path(get, path = "/v1/uploads", operation_id = "list_uploads", tag = "uploads", params(PageQuery),
    responses((status = 200, body = UploadList, headers(("Link" = String))), (status = 422, body = Problem)))]
pub async fn list(
    State(state): State<AppState>,
    uri: Uri,
    QueryParameters(query): QueryParameters<PageQuery>,
) -> Result<Response, ApiError> {
    let read = move |store: &Store, limit| store.uploads(query.cursor.as_ref().map(|cursor| cursor.0.as_str()), limit);
    resource::page::<UploadRow, UploadList>(&state, &uri, query.limit, read).await
}

/// An upload: its state, and what was found in the file.
#[utoipa::path(get, path = "/v1/uploads/{id}", operation_id = "get_upload", tag = "uploads", params(("id" = String, Path)),
    responses((status = 200, body = UploadView), (status = 404, body = Problem)))]
pub async fn get(State(state): State<AppState>, UrlPath(id): UrlPath<String>) -> Result<Json<UploadView>, ApiError> {
    resource::get::<UploadRow>(&state, id).await
}

/// Deletes an upload that no unfinished job uses.
#[utoipa::path(delete, path = "/v1/uploads/{id}", operation_id = "delete_upload", tag = "uploads", params(("id" = String, Path)),
    responses((status = 204), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn delete(
    State(state): State<AppState>,
    Extension(client): Extension<Client>,
    UrlPath(id): UrlPath<String>,
) -> Result<StatusCode, ApiError> {
    resource::delete::<UploadRow>(&state, &client, id).await
}
