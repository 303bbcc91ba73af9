//! The service from start to end: store, supervisor, listener.

use crate::calibration;
use crate::config::Config;
use crate::router;
use crate::state::{AppState, Handles, ServicePhase};
use crate::telemetry;
use meniscus_jobs::service::executor::local::LocalExecutor;
use meniscus_jobs::service::inspector;
use meniscus_jobs::service::store::{Store, StoreError};
use meniscus_jobs::service::supervisor::Supervisor;
use meniscus_jobs::system::lock::{DirectoryLock, LockError};
use metrics_exporter_prometheus::PrometheusHandle;
use std::future::IntoFuture;
use std::io::{self, Write};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;

/// Why the service could not run.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The data directory is in use.
    #[error(transparent)]
    Lock(#[from] LockError),
    /// The store cannot be opened.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A call of the operating system failed, such as binding the address.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// Time between two checks of the store's log.
const LOG_INTERVAL: Duration = Duration::from_millis(250);
/// Time that open answers have to end after the supervisor has ended.
const LAST_ANSWERS: Duration = Duration::from_secs(1);

/// Runs the service until SIGTERM or SIGINT. Running jobs then write a checkpoint and return to the queue.
///
/// # Errors
/// [`ServeError`].
pub async fn serve(config: Config) -> Result<(), ServeError> {
    std::fs::create_dir_all(&config.data)?;
    // Workers get paths that do not depend on a current directory.
    let config = Config { data: std::fs::canonicalize(&config.data)?, ..config };
    let _lock = DirectoryLock::take(&config.data)?;
    let (stop, stopping) = watch::channel(false);
    let (state, supervisor) = build(config, stopping)?;
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    let listener = TcpListener::bind(state.config.bind).await?;
    announce(&listener.local_addr()?.to_string())?;
    let supervision = start_supervision(supervisor, state.phase.clone())?;
    tidy_up(&state.store, state.metrics.clone())?;
    if state.config.calibrate {
        calibration::start_where_needed(&state.store, state.config.threads)?;
    }
    let mut stopped = state.stopping.clone();
    let until_stopped = async move {
        let _ = stopped.wait_for(|stopped| *stopped).await;
    };
    let server = axum::serve(listener, router::router(state.clone())).with_graceful_shutdown(until_stopped);
    let answers = tokio::spawn(server.into_future());
    tokio::select! {
        _ = terminate.recv() => {}
        _ = interrupt.recv() => {}
    }
    tracing::info!("stopping: running jobs write a checkpoint and return to the queue");
    state.phase.set_draining();
    state.supervisor.shut_down();
    // The store closes when nothing holds it any more.
    drop(state);
    let joined = tokio::task::spawn_blocking(move || supervision.join()).await;
    if !matches!(joined, Ok(Ok(()))) {
        tracing::error!("the supervisor ended with an error");
    }
    let _ = stop.send(true);
    // Clients that still read are cut off after a moment.
    let _ = tokio::time::timeout(LAST_ANSWERS, answers).await;
    Ok(())
}

/// Opens the store and makes everything that handlers need, and the supervisor, which does not run yet.
fn build(config: Config, stopping: watch::Receiver<bool>) -> Result<(AppState, Supervisor), ServeError> {
    let store = Arc::new(Store::open(&config.data)?);
    // The running program, even if an upgrade has replaced its file: all workers of a service are of one build.
    let executor = Box::new(LocalExecutor::new("/proc/self/exe".into()));
    let supervisor = Supervisor::new(Arc::clone(&store), executor, config.settings());
    let inspector = inspector::start(Arc::clone(&store), "/proc/self/exe".into())?;
    let handles = Handles { store, supervisor: supervisor.handle(), inspector, metrics: telemetry::metrics()? };
    Ok((AppState::new(handles, config, stopping), supervisor))
}

/// Recovers the jobs and runs the supervisor, on a thread of its own. The service is ready after the recovery.
fn start_supervision(mut supervisor: Supervisor, phase: ServicePhase) -> io::Result<JoinHandle<()>> {
    std::thread::Builder::new().name("supervisor".to_owned()).spawn(move || {
        if let Err(error) = supervisor.recover() {
            tracing::error!(%error, "recovery failed; the service stays unready");
            return;
        }
        phase.set_ready();
        tracing::info!("ready");
        supervisor.run();
    })
}

/// Trims the store's log and the samples of histograms as long as the store exists, on a thread of its own.
fn tidy_up(store: &Arc<Store>, metrics: PrometheusHandle) -> io::Result<()> {
    let mut changes = store.watch();
    let store = Arc::downgrade(store);
    std::thread::Builder::new().name("tidy-up".to_owned()).spawn(move || {
        loop {
            std::thread::sleep(LOG_INTERVAL);
            let Some(store) = store.upgrade() else { return };
            metrics.run_upkeep();
            let is_idle = !changes.has_changed().unwrap_or(true);
            changes.mark_unchanged();
            if let Err(error) = store.trim_log(is_idle) {
                tracing::warn!(%error, "the store's log could not be trimmed");
            }
        }
    })?;
    Ok(())
}

/// Writes the address of the service as the first line on standard output.
fn announce(address: &str) -> io::Result<()> {
    let mut output = io::stdout().lock();
    writeln!(output, "listening on http://{address}")?;
    output.flush()
}
