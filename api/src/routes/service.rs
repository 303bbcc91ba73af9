//! Version, limits and health of the service.

use crate::base_path::address;
use crate::error::{ApiError, Problem};
use crate::routes::jobs::BODY_LIMIT;
use crate::routes::studies;
use crate::state::AppState;
use crate::views::{ServiceLimits, ServiceView, StatusView};
use axum::Json;
use axum::extract::State;
use meniscus_jobs::system::build;
use std::collections::BTreeMap;

/// Version and limits of the service, and links to all lists.
#[utoipa::path(get, path = "/v1", operation_id = "service_index", tag = "service", responses((status = 200, body = ServiceView)))]
pub async fn index(State(state): State<AppState>) -> Json<ServiceView> {
    let allowance = state.config.allowance();
    Json(ServiceView {
        name: "meniscus",
        build: build::name(),
        isa: build::isa(),
        limits: ServiceLimits {
            slots: state.config.slots,
            threads: allowance.threads,
            memory_bytes: allowance.memory_bytes,
            body_bytes: BODY_LIMIT,
            study_bytes: studies::BODY_LIMIT,
            upload_bytes: state.config.upload_bytes,
        },
        links: BTreeMap::from([
            ("scenes", address("/v1/scenes")),
            ("estimates", address("/v1/estimates")),
            ("jobs", address("/v1/jobs")),
            ("studies", address("/v1/studies")),
            ("uploads", address("/v1/uploads")),
            ("metrics", address("/metrics")),
            ("openapi", address("/openapi.json")),
            ("tickets", address("/v1/tickets")),
        ]),
    })
}

/// The process is alive.
#[utoipa::path(get, path = "/healthz", operation_id = "service_health", tag = "service", responses((status = 200, body = StatusView)))]
pub async fn health() -> Json<StatusView> {
    Json(StatusView { status: "ok" })
}

/// The service has recovered its jobs, can write its data directory and accepts requests.
#[utoipa::path(get, path = "/readyz", operation_id = "service_readiness", tag = "service",
    responses((status = 200, body = StatusView), (status = 503, body = Problem)))]
pub async fn ready(State(state): State<AppState>) -> Result<Json<StatusView>, ApiError> {
    match state.phase.is_ready() {
        true if !state.phase.is_writable() => Err(ApiError::Unwritable),
        true => Ok(Json(StatusView { status: "ok" })),
        false => Err(ApiError::NotReady),
    }
}
