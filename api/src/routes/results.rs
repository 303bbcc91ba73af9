//! What a job has to say: log, series, report.

use crate::application::Application;
use crate::error::{ApiError, Problem};
use crate::file_response::{FileFacts, bytes_response};
use crate::routes::{accepts, files, job, number, refuse_unknown, with_store};
use axum::Json;
use axum::extract::{Path, Query, State};
use axum::http::HeaderMap;
use axum::response::{IntoResponse, Response};
use meniscus_jobs::formats::csv;
use meniscus_jobs::service::store::JobRow;
use meniscus_jobs::spec::attempt_spec::attempt_directory;
use meniscus_jobs::worker::attempt;
use meniscus_jobs::worker::observers::series;

/// A file of every attempt, in order, as far as it is there.
fn of_attempts(application: &Application, row: &JobRow, name: &str) -> Vec<Vec<u8>> {
    let directory = application.store.job_directory(&row.id);
    (1..=row.attempt).filter_map(|n| std::fs::read(attempt_directory(&directory, n).join(name)).ok()).collect()
}

/// The log of all attempts; `tail` keeps the last lines.
#[utoipa::path(get, path = "/v1/jobs/{id}/log", tag = "results",
    params(("id" = String, Path), ("tail" = Option<usize>, Query), ("Range" = Option<String>, Header)),
    responses((status = 200, content_type = "text/plain"), (status = 206), (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn log(
    State(application): State<Application>,
    Path(id): Path<String>,
    Query(query): Query<Vec<(String, String)>>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    refuse_unknown(&query, &["tail"])?;
    let tail = number(&query, "tail")?;
    let row = job(&application, &id).await?;
    let reader = application.clone();
    let text = with_store(&application, move |_| Ok(of_attempts(&reader, &row, attempt::LOG_NAME).concat())).await?;
    let text = match tail {
        None => text,
        Some(tail) => {
            let lines: Vec<&[u8]> = text.split_inclusive(|b| *b == b'\n').collect();
            lines[lines.len().saturating_sub(usize::try_from(tail).unwrap_or(usize::MAX))..].concat()
        }
    };
    let facts =
        FileFacts { sha256: None, media_type: "text/plain; charset=utf-8".to_owned(), name: format!("{id}.log") };
    bytes_response(&text, &facts, &headers)
}

/// The observables over time, as CSV or as JSON by `Accept`.
#[utoipa::path(get, path = "/v1/jobs/{id}/series", tag = "results",
    params(("id" = String, Path), ("Accept" = Option<String>, Header)),
    responses((status = 200, content_type = "text/csv"), (status = 404, body = Problem)))]
pub async fn series(
    State(application): State<Application>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let row = job(&application, &id).await?;
    let directory = application.store.job_directory(&row.id);
    // The newest attempt that has come so far continues all earlier ones.
    let mut places = (1..=row.attempt).rev().map(|n| attempt_directory(&directory, n).join(series::FILE_NAME));
    let newest = places.find(|place| place.is_file());
    let text =
        with_store(&application, move |_| Ok(newest.map(std::fs::read).transpose()?.unwrap_or_default())).await?;
    if accepts(&headers, "json", "text/csv") {
        return Ok(Json(csv::to_json(&String::from_utf8_lossy(&text))).into_response());
    }
    let facts = FileFacts { sha256: None, media_type: "text/csv".to_owned(), name: format!("{id}.csv") };
    bytes_response(&text, &facts, &headers)
}

/// Errors, cost, stability of a finished job.
#[utoipa::path(get, path = "/v1/jobs/{id}/report", tag = "results", params(("id" = String, Path)),
    responses((status = 200, content_type = "application/json"), (status = 404, body = Problem)))]
pub async fn report(
    State(application): State<Application>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    files::answer(&application, &id, "report.json", &headers).await
}
