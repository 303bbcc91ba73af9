//! Results of a job: log, series, report.

use crate::accept;
use crate::error::{ApiError, Problem};
use crate::file_response::{FileFacts, bytes_response};
use crate::path::Path;
use crate::query::QueryParameters;
use crate::resource;
use crate::routes::files;
use crate::state::AppState;
use crate::views::ReportView;
use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::{IntoResponse, Response};
use meniscus_jobs::formats::csv;
use meniscus_jobs::service::store::{JobRow, Store};
use meniscus_jobs::spec::attempt_files::{self, attempt_directory};
use serde::Deserialize;

/// Which part of a log.
#[derive(Debug, Clone, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct LogQuery {
    /// Number of lines at the end of the log; all lines by default.
    tail: Option<u64>,
}

/// The content of a file of every attempt in order. Attempts without the file are left out.
fn read_attempts(store: &Store, row: &JobRow, name: &str) -> Vec<Vec<u8>> {
    let directory = store.job_directory(&row.id);
    (1..=row.attempt).filter_map(|n| std::fs::read(attempt_directory(&directory, n).join(name)).ok()).collect()
}

/// The log of all attempts of a job.
#[utoipa::path(get, path = "/v1/jobs/{id}/log", operation_id = "job_log", tag = "results",
    params(("id" = String, Path), LogQuery, ("Range" = Option<String>, Header)),
    responses((status = 200, content_type = "text/plain"), (status = 206), (status = 404, body = Problem), (status = 422, body = Problem)))]
pub async fn log(
    State(state): State<AppState>,
    Path(id): Path<String>,
    QueryParameters(query): QueryParameters<LogQuery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let row = resource::find::<JobRow>(&state, id.clone()).await?;
    let read = move |store: &Store| Ok::<_, ApiError>(read_attempts(store, &row, attempt_files::LOG).concat());
    let text = state.with_store(read).await?;
    let text = match query.tail {
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

/// Observables over time, as CSV or as JSON by `Accept`.
#[utoipa::path(get, path = "/v1/jobs/{id}/series", operation_id = "job_series", tag = "results",
    params(("id" = String, Path), ("Accept" = Option<String>, Header)),
    responses((status = 200, content_type = "text/csv"), (status = 404, body = Problem)))]
pub async fn series(
    State(state): State<AppState>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let row = resource::find::<JobRow>(&state, id.clone()).await?;
    let directory = state.store.job_directory(&row.id);
    // The series of the newest attempt that has one continues all earlier ones.
    let mut places = (1..=row.attempt).rev().map(|n| attempt_directory(&directory, n).join(attempt_files::SERIES));
    let newest = places.find(|place| place.is_file());
    let read = move |_: &Store| Ok::<_, ApiError>(newest.map(std::fs::read).transpose()?.unwrap_or_default());
    let text = state.with_store(read).await?;
    if accept::prefers(&headers, "json", "text/csv") {
        return Ok(Json(csv::to_json(&String::from_utf8_lossy(&text))).into_response());
    }
    let facts = FileFacts { sha256: None, media_type: "text/csv".to_owned(), name: format!("{id}.csv") };
    bytes_response(&text, &facts, &headers)
}

/// Errors, cost, health and diagnostics of a finished job.
#[utoipa::path(get, path = "/v1/jobs/{id}/report", operation_id = "job_report", tag = "results", params(("id" = String, Path)),
    responses((status = 200, body = ReportView), (status = 404, body = Problem)))]
pub async fn report(
    State(state): State<AppState>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    files::answer(&state, &id, attempt_files::REPORT, &headers).await
}
