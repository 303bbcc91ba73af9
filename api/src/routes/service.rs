//! What the service is and whether it works.

use crate::application::Application;
use crate::error::{ApiError, Problem};
use crate::routes::jobs::BODY_LIMIT;
use crate::routes::studies;
use crate::views::{ServiceLimits, ServiceView, StatusView};
use axum::Json;
use axum::extract::State;
use meniscus_jobs::system::build;
use std::collections::BTreeMap;
use std::sync::atomic::Ordering;

/// Version, limits, links.
#[utoipa::path(get, path = "/v1", tag = "service", responses((status = 200, body = ServiceView)))]
pub async fn index(State(application): State<Application>) -> Json<ServiceView> {
    let allowance = application.config.allowance();
    Json(ServiceView {
        name: "meniscus",
        build: build::name(),
        isa: build::isa(),
        limits: ServiceLimits {
            slots: application.config.slots,
            threads: allowance.threads,
            memory_bytes: allowance.memory_bytes,
            body_bytes: BODY_LIMIT,
            study_bytes: studies::BODY_LIMIT,
            upload_bytes: application.config.upload_bytes,
        },
        links: BTreeMap::from([
            ("scenes", "/v1/scenes"),
            ("estimates", "/v1/estimates"),
            ("jobs", "/v1/jobs"),
            ("studies", "/v1/studies"),
            ("uploads", "/v1/uploads"),
            ("metrics", "/metrics"),
            ("openapi", "/openapi.json"),
        ]),
    })
}

/// The process answers.
#[utoipa::path(get, path = "/healthz", tag = "service", responses((status = 200, body = StatusView)))]
pub async fn health() -> Json<StatusView> {
    Json(StatusView { status: "ok" })
}

/// Every unfinished job is in a legal state; work is accepted.
#[utoipa::path(get, path = "/readyz", tag = "service",
    responses((status = 200, body = StatusView), (status = 503, body = Problem)))]
pub async fn ready(State(application): State<Application>) -> Result<Json<StatusView>, ApiError> {
    if application.ready.load(Ordering::Acquire) {
        Ok(Json(StatusView { status: "ok" }))
    } else {
        Err(ApiError::NotReady)
    }
}
