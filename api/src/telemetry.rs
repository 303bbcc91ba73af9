//! Log on standard error, and metrics. `MENISCUS_LOG` sets the level (default `info`), `MENISCUS_LOG_FORMAT=json` the format.

use metrics::{describe_counter, describe_gauge, describe_histogram};
use metrics_exporter_prometheus::{PrometheusBuilder, PrometheusHandle};
use tracing_subscriber::EnvFilter;

/// Starts logging. A second call changes nothing.
pub fn start() {
    let filter = EnvFilter::try_from_env("MENISCUS_LOG").unwrap_or_else(|_| EnvFilter::new("info"));
    // Nothing is reported if the log cannot be written, for example because its disk is full.
    let builder =
        tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).log_internal_errors(false);
    let json = std::env::var("MENISCUS_LOG_FORMAT").is_ok_and(|format| format == "json");
    // A test may have set its own subscriber.
    let _ = if json { builder.json().try_init() } else { builder.with_ansi(false).try_init() };
}

/// Installs the recorder of metrics for `/metrics`.
///
/// # Errors
/// If a recorder is already installed.
pub fn metrics() -> std::io::Result<PrometheusHandle> {
    let seconds = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.5, 2.0, 10.0, 60.0];
    let recorder = PrometheusBuilder::new().set_buckets(&seconds).map_err(std::io::Error::other)?.build_recorder();
    let handle = recorder.handle();
    metrics::set_global_recorder(recorder).map_err(|error| std::io::Error::other(error.to_string()))?;
    describe_counter!("meniscus_http_requests_total", "requests by method, route and status");
    describe_histogram!("meniscus_http_request_seconds", "seconds until the head of the answer, by route");
    describe_gauge!("meniscus_jobs", "jobs by state");
    describe_gauge!("meniscus_queue_oldest_seconds", "seconds that the oldest queued job has waited");
    describe_gauge!("meniscus_event_streams", "open event streams");
    describe_gauge!("meniscus_store_bytes", "bytes of the database and its log");
    describe_gauge!("meniscus_uploads_quarantined", "uploads that are not examined yet");
    describe_gauge!("meniscus_disk_free_bytes", "free bytes where jobs write");
    describe_gauge!("meniscus_disk_reserve_bytes", "bytes that jobs leave free");
    describe_gauge!("meniscus_resident_bytes", "resident memory of the service in bytes");
    describe_gauge!("meniscus_memory_available_bytes", "bytes of memory available to new workers");
    describe_gauge!("meniscus_slots", "jobs that run at the same time");
    describe_gauge!("meniscus_connections", "open connections of clients");
    describe_gauge!("meniscus_cpu_seconds", "CPU seconds of the service so far");
    describe_counter!("meniscus_transitions_total", "changes of the state of jobs, by new state and reason");
    describe_gauge!("meniscus_slurm_table_age_seconds", "age of the cluster's last answer");
    describe_gauge!("meniscus_slurm_jobs", "jobs of this service in the cluster, waiting and running");
    describe_gauge!("meniscus_slurm_node_jobs", "jobs of this service on a node of the cluster");
    describe_gauge!("meniscus_slurm_node_excluded", "1 for a node that is left out because it lost attempts, else 0");
    describe_gauge!("meniscus_slurm_unsure", "submissions of which it is not known whether the cluster has them");
    describe_counter!("meniscus_slurm_evictions_total", "attempts that the cluster took away, by cause");
    describe_histogram!("meniscus_slurm_sbatch_seconds", "seconds that a submission took");
    describe_histogram!("meniscus_slurm_squeue_seconds", "seconds that a look at the cluster's table took");
    Ok(handle)
}
