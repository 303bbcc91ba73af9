//! Uploads: checkpoints, points, surfaces, places to ask about.

use crate::access::Client;
use crate::application::Application;
use crate::creation::{self, kept};
use crate::error::{ApiError, Problem, ProblemItem};
use crate::routes::{Page, refuse_unknown, with_store};
use crate::views::{UploadList, UploadView};
use axum::Json;
use axum::body::Body;
use axum::extract::{Path, Query, Request, State};
use axum::http::{StatusCode, header};
use axum::response::Response;
use meniscus::scene::Violation;
use meniscus_jobs::service::store::uploads::CONTENT;
use meniscus_jobs::service::store::{NewUpload, Once, UploadRow};
use meniscus_jobs::spec::uploads::Purpose;
use meniscus_jobs::system::artifacts;
use meniscus_jobs::system::digest;
use meniscus_jobs::system::process;
use serde_json::{Value, json};
use std::path::PathBuf;
use tokio::io::AsyncWriteExt;
use tokio_stream::StreamExt;

/// Takes a file in. It is `quarantined` until a process of its own has looked into it, then `ready` or `rejected`.
#[utoipa::path(post, path = "/v1/uploads", tag = "uploads",
    params(("as" = String, Query, description = "checkpoint, points, surface or queries"), ("name" = Option<String>, Query),
        ("Idempotency-Key" = Option<String>, Header)),
    request_body(content = Vec<u8>, content_type = "application/octet-stream", description = "the file: HDF5; surfaces and queries also PLY, OBJ or XYZ"),
    responses((status = 201, body = UploadView, headers(("Location" = String))), (status = 413, body = Problem),
        (status = 415, body = Problem), (status = 422, body = Problem), (status = 429, body = Problem), (status = 507, body = Problem)))]
pub async fn submit(
    State(application): State<Application>,
    Query(query): Query<Vec<(String, String)>>,
    request: Request,
) -> Result<Response, ApiError> {
    refuse_unknown(&query, &["as", "name"])?;
    let text = |name: &str| query.iter().find(|(key, _)| key == name).map(|(_, value)| value.clone());
    let purpose = text("as").as_deref().and_then(Purpose::from_word).ok_or_else(|| {
        let words: Vec<&str> = Purpose::ALL.iter().map(|purpose| purpose.word()).collect();
        let detail = "an upload says what it is to be used as: ?as=…";
        let violation = Violation::new("as", "required", detail, &json!(text("as")), json!(words));
        ApiError::Invalid(vec![ProblemItem::from(violation)])
    })?;
    let name = text("name").map(|name| name.chars().take(200).collect());
    let (parts, body) = request.into_parts();
    let kind = parts.headers.get(header::CONTENT_TYPE).and_then(|v| v.to_str().ok()).unwrap_or_default();
    if kind.starts_with("multipart/") || kind.starts_with("application/json") {
        return Err(ApiError::UnsupportedMedia);
    }
    let client = parts.extensions.get::<Client>().cloned().unwrap_or_default();
    let budget = creation::spend(&application, &client)?;
    let key = creation::key_of(&parts.headers)?;
    let limit = application.config.upload_bytes;
    let announced = creation::announced(&parts.headers);
    if announced.is_some_and(|length| length > limit) {
        return Err(ApiError::TooLarge(limit));
    }
    let room = process::free_space(application.store.directory())
        .unwrap_or(u64::MAX)
        .saturating_sub(application.config.disk_reserve_bytes);
    if announced.unwrap_or(0) > room {
        return Err(ApiError::NoSpace { needed: announced.unwrap_or(0), room });
    }
    let (id, directory) = with_store(&application, |store| Ok(store.begin_upload()?)).await?;
    // Whatever ends this before the file is whole, a client that goes away too, leaves nothing behind.
    let mut leftover = Leftover { directory: Some(directory.clone()) };
    let path = directory.join(CONTENT);
    let reserve = application.config.disk_reserve_bytes;
    let size_bytes = take(body, path.clone(), limit.min(room), limit, reserve).await?;
    leftover.directory = None;
    let target = parts.uri.path_and_query().map_or_else(String::new, |target| target.as_str().to_owned());
    let made = with_store(&application, move |store| {
        let finished = artifacts::finish(&path).and_then(|()| digest::of_file(&path));
        let (sha256, _) = match finished {
            Ok(found) => found,
            Err(error) => {
                store.abandon_upload(&id)?;
                return Err(error.into());
            }
        };
        let once = key.map(|key| Once {
            owner: client.0,
            key,
            request_sha256: digest::of_bytes(format!("POST\n{target}\n{sha256}").as_bytes()),
        });
        let upload = NewUpload { id, purpose, name, size_bytes, sha256 };
        let answer = |row: &UploadRow| {
            kept(StatusCode::CREATED, Some(format!("/v1/uploads/{}", row.id)), &UploadView::from(row.clone()))
        };
        Ok(store.make_upload(&upload, once.as_ref(), answer)?)
    })
    .await?;
    application.inspector.wake();
    creation::answer(made, budget)
}

/// The directory of an upload that has not come to its end.
struct Leftover {
    directory: Option<PathBuf>,
}

impl Drop for Leftover {
    fn drop(&mut self) {
        if let Some(directory) = &self.directory {
            // The next start sweeps what cannot be removed now.
            let _ = std::fs::remove_dir_all(directory);
        }
    }
}

/// Bytes of an upload between two looks at the free space.
const CHECK_BYTES: u64 = 16 << 20;

/// Writes a body into an unfinished file; its size.
async fn take(body: Body, path: PathBuf, most: u64, limit: u64, reserve: u64) -> Result<u64, ApiError> {
    let mut file = tokio::fs::File::create(artifacts::unfinished(&path)).await?;
    let mut stream = body.into_data_stream();
    let mut size = 0_u64;
    while let Some(bytes) = stream.next().await {
        let bytes = bytes.map_err(|error| ApiError::Unparsable(error.to_string()))?;
        size += bytes.len() as u64;
        if size > limit {
            return Err(ApiError::TooLarge(limit));
        }
        if size > most {
            return Err(ApiError::NoSpace { needed: size, room: most });
        }
        file.write_all(&bytes).await?;
        // Others write, too: what was room at the start may be gone.
        if size / CHECK_BYTES != (size - bytes.len() as u64) / CHECK_BYTES {
            let left = process::free_space(&path).unwrap_or(u64::MAX);
            if left < reserve {
                return Err(ApiError::NoSpace { needed: size, room: 0 });
            }
        }
    }
    file.flush().await?;
    if size == 0 {
        let violation = Violation::new("", "required", "the file is empty", &Value::Null, Value::Null);
        return Err(ApiError::Invalid(vec![ProblemItem::from(violation)]));
    }
    Ok(size)
}

/// A page of uploads, newest first.
#[utoipa::path(get, path = "/v1/uploads", tag = "uploads",
    params(("limit" = Option<u64>, Query), ("cursor" = Option<String>, Query)),
    responses((status = 200, body = UploadList, headers(("Link" = String))), (status = 422, body = Problem)))]
pub async fn list(
    State(application): State<Application>,
    Query(query): Query<Vec<(String, String)>>,
) -> Result<Response, ApiError> {
    let page = Page::of(&query, &[])?;
    let (cursor, limit) = (page.cursor.clone(), page.limit + 1);
    let rows = with_store(&application, move |store| Ok(store.uploads(cursor.as_deref(), limit)?)).await?;
    Ok(page.answer(
        "/v1/uploads",
        rows,
        |row| row.id.clone(),
        |items, next| UploadList { items: items.into_iter().map(UploadView::from).collect(), next },
    ))
}

async fn upload(application: &Application, id: String) -> Result<UploadRow, ApiError> {
    with_store(application, move |store| store.upload(&id)?.ok_or(ApiError::NotFound("upload"))).await
}

/// An upload: its state, and what was found in it.
#[utoipa::path(get, path = "/v1/uploads/{id}", tag = "uploads", params(("id" = String, Path)),
    responses((status = 200, body = UploadView), (status = 404, body = Problem)))]
pub async fn get(State(application): State<Application>, Path(id): Path<String>) -> Result<Json<UploadView>, ApiError> {
    Ok(Json(upload(&application, id).await?.into()))
}

/// Deletes an upload that no unfinished job uses.
#[utoipa::path(delete, path = "/v1/uploads/{id}", tag = "uploads", params(("id" = String, Path)),
    responses((status = 204), (status = 404, body = Problem), (status = 409, body = Problem)))]
pub async fn delete(State(application): State<Application>, Path(id): Path<String>) -> Result<StatusCode, ApiError> {
    let row = upload(&application, id).await?;
    if with_store(&application, move |store| Ok(store.delete_upload(&row.id)?)).await? {
        return Ok(StatusCode::NO_CONTENT);
    }
    Err(ApiError::Conflict("it is being looked into, or a job that has not ended uses it".to_owned()))
}
