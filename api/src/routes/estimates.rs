//! What a job would take, without making it.

use crate::application::Application;
use crate::creation::read;
use crate::error::{ApiError, Problem};
use crate::routes::jobs::BODY_LIMIT;
use crate::routes::{StoreSources, with_store};
use crate::views::EstimateView;
use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use meniscus_jobs::spec::strict_json;

/// Checks a job's body and says what it would take. Nothing is made.
#[utoipa::path(post, path = "/v1/estimates", tag = "jobs",
    request_body(content = Object, description = "a job body, as for POST /v1/jobs"),
    responses((status = 200, body = EstimateView), (status = 400, body = Problem), (status = 413, body = Problem),
        (status = 422, body = Problem)))]
pub async fn estimate(
    State(application): State<Application>,
    headers: HeaderMap,
    content: Body,
) -> Result<Json<EstimateView>, ApiError> {
    let bytes = read(&headers, content, BODY_LIMIT).await?;
    let allowance = application.config.allowance();
    with_store(&application, move |store| {
        let spec = strict_json::parse(&bytes).map_err(|error| ApiError::Unparsable(error.to_string()))?;
        let body = StoreSources::new(store).understand(&spec, allowance, &store.calibration()?)?;
        Ok(Json(EstimateView::from(body)))
    })
    .await
}
