//! What a job would need, without creating it.

use crate::error::{ApiError, Problem};
use crate::request_body;
use crate::routes::jobs::BODY_LIMIT;
use crate::state::AppState;
use crate::store_sources::StoreSources;
use crate::views::EstimateView;
use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use meniscus_jobs::service::accuracy;

/// Checks the body of a job and estimates its particles, steps, memory, disk space and time. Creates nothing.
#[utoipa::path(post, path = "/v1/estimates", operation_id = "estimate_job", tag = "jobs",
    request_body(content = Object, description = "a job"),
    responses((status = 200, body = EstimateView), (status = 400, body = Problem), (status = 413, body = Problem),
        (status = 422, body = Problem)))]
pub async fn estimate(
    State(state): State<AppState>,
    headers: HeaderMap,
    content: Body,
) -> Result<Json<EstimateView>, ApiError> {
    let bytes = request_body::read(&headers, content, BODY_LIMIT).await?;
    let allowance = state.config.allowance();
    let estimated = state.with_store(move |store| {
        let spec = request_body::parse_json(&bytes)?;
        let body = StoreSources::new(store).resolve(&spec, allowance, &store.calibration()?)?;
        if let Some(wanted) = &body.wanted {
            if let Some(mut known) = accuracy::known_body(store, &body, wanted, allowance)? {
                known.forecast.time_by(&store.calibration()?);
                return Ok(Json(EstimateView::from(known)));
            }
            let study = accuracy::study_for(store, &body, wanted, allowance)?;
            return Ok(Json(EstimateView::of_accuracy(&body, &study.forecast)));
        }
        Ok::<_, ApiError>(Json(EstimateView::from(body)))
    });
    estimated.await
}
