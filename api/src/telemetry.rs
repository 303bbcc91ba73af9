//! Logs on standard error; `MENISCUS_LOG` chooses what (default `info`), `MENISCUS_LOG_FORMAT=json` how.

use metrics::{describe_counter, describe_gauge, describe_histogram};
use metrics_exporter_prometheus::{PrometheusBuilder, PrometheusHandle};
use tracing_subscriber::EnvFilter;

/// Starts logging. A second call changes nothing.
pub fn start() {
    let filter = EnvFilter::try_from_env("MENISCUS_LOG").unwrap_or_else(|_| EnvFilter::new("info"));
    // A log that cannot be written (its disk is full) must not end anything: no words about it on standard error.
    let builder =
        tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).log_internal_errors(false);
    let json = std::env::var("MENISCUS_LOG_FORMAT").is_ok_and(|format| format == "json");
    // Tests may have set a subscriber of their own.
    let _ = if json { builder.json().try_init() } else { builder.with_ansi(false).try_init() };
}

/// Starts counting for `/metrics`.
///
/// # Errors
/// When something else counts already.
pub fn metrics() -> std::io::Result<PrometheusHandle> {
    let seconds = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.5, 2.0, 10.0, 60.0];
    let recorder = PrometheusBuilder::new().set_buckets(&seconds).map_err(std::io::Error::other)?.build_recorder();
    let handle = recorder.handle();
    metrics::set_global_recorder(recorder).map_err(|error| std::io::Error::other(error.to_string()))?;
    describe_counter!("meniscus_http_requests_total", "requests by method, route and status");
    describe_histogram!("meniscus_http_request_seconds", "time to the head of the answer, by route");
    describe_gauge!("meniscus_jobs", "jobs by state");
    describe_gauge!("meniscus_queue_oldest_seconds", "waiting time of the oldest job of the queue");
    describe_gauge!("meniscus_event_streams", "open streams of events");
    describe_gauge!("meniscus_store_bytes", "size of the store and its log");
    describe_gauge!("meniscus_uploads_quarantined", "uploads that nobody has looked into yet");
    describe_gauge!("meniscus_disk_free_bytes", "free space of the data directory");
    describe_gauge!("meniscus_disk_reserve_bytes", "free space that jobs leave untouched");
    describe_gauge!("meniscus_resident_bytes", "resident memory of the service");
    describe_gauge!("meniscus_memory_available_bytes", "memory that new workers can have");
    describe_counter!(
        "meniscus_transitions_total",
        "changes of state of jobs, by the state they came to and the reason"
    );
    Ok(handle)
}
