//! Counters and gauges for operators, as Prometheus text.

use crate::error::{ApiError, Problem};
use crate::state::AppState;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use meniscus_jobs::spec::states::State as JobState;
use meniscus_jobs::system::process;
use metrics::gauge;

/// Counters and gauges as Prometheus text.
#[utoipa::path(get, path = "/metrics", operation_id = "metrics", tag = "service",
    responses((status = 200, content_type = "text/plain"), (status = 503, body = Problem)))]
pub async fn metrics(State(state): State<AppState>) -> Result<Response, ApiError> {
    let statistics = state.with_store(|store| Ok::<_, ApiError>(store.statistics()?)).await?;
    for state in JobState::ALL {
        let count = statistics.by_state.get(state).copied().unwrap_or(0);
        gauge!("meniscus_jobs", "state" => state.word()).set(count as f64);
    }
    gauge!("meniscus_queue_oldest_seconds").set(statistics.oldest_queued_s);
    gauge!("meniscus_store_bytes").set(statistics.store_bytes as f64);
    gauge!("meniscus_uploads_quarantined").set(statistics.quarantined as f64);
    gauge!("meniscus_slots").set(state.config.slots as f64);
    let free = process::free_space(state.store.jobs_directory()).unwrap_or(0);
    gauge!("meniscus_disk_free_bytes").set(free as f64);
    gauge!("meniscus_disk_reserve_bytes").set(state.config.disk_reserve_bytes as f64);
    gauge!("meniscus_resident_bytes").set(process::resident_bytes(std::process::id()).unwrap_or(0) as f64);
    gauge!("meniscus_cpu_seconds").set(process::cpu_seconds());
    gauge!("meniscus_memory_available_bytes").set(process::available_memory().unwrap_or(0) as f64);
    let text = state.metrics.render();
    Ok(([(header::CONTENT_TYPE, "text/plain; version=0.0.4")], text).into_response())
}
