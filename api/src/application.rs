//! The service as a whole: store, supervisor, listener, and their orderly start and end.

use crate::calibration;
use crate::config::Config;
use crate::router;
use crate::shown::ShownJobs;
use crate::telemetry;
use meniscus_jobs::service::executor::local::LocalExecutor;
use meniscus_jobs::service::inspector::{self, InspectorHandle};
use meniscus_jobs::service::store::{Store, StoreError};
use meniscus_jobs::service::supervisor::{Supervisor, SupervisorHandle};
use meniscus_jobs::system::lock::{DirectoryLock, LockError};
use metrics_exporter_prometheus::PrometheusHandle;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::{Semaphore, watch};

/// What every handler can reach.
#[derive(Clone)]
pub struct Application {
    /// Jobs.
    pub store: Arc<Store>,
    /// Who runs them.
    pub supervisor: SupervisorHandle,
    /// Who looks into uploads.
    pub inspector: InspectorHandle,
    /// Counts for operators.
    pub metrics: PrometheusHandle,
    /// The operator's choice.
    pub config: Arc<Config>,
    /// Whether recovery is done and no shutdown has begun.
    pub ready: Arc<AtomicBool>,
    /// Whether a shutdown has begun: the store can still be read.
    pub draining: Arc<AtomicBool>,
    /// Jobs as they were last shown.
    pub shown: ShownJobs,
    /// Archives that may be under way at once; each holds a thread for as long as its reader takes.
    pub archives: Arc<Semaphore>,
    /// Turns true when the service stops; long answers end then.
    pub stopping: watch::Receiver<bool>,
}

/// Why a service could not run.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The data directory is taken.
    #[error(transparent)]
    Lock(#[from] LockError),
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The system failed.
    #[error("{0}")]
    Io(#[from] std::io::Error),
}

/// Time between two looks at the store's log.
const LOG_INTERVAL: Duration = Duration::from_millis(250);
/// Archives at once.
const ARCHIVES: usize = 6;
/// Time that open answers have to end after the supervisor has.
const LAST_ANSWERS: Duration = Duration::from_secs(1);

/// Runs the service until SIGTERM or SIGINT: running jobs then checkpoint and go back to the queue.
///
/// # Errors
/// [`ServeError`].
pub async fn serve(config: Config) -> Result<(), ServeError> {
    std::fs::create_dir_all(&config.data)?;
    // Paths in orders to workers must hold wherever those run.
    let config = Config { data: std::fs::canonicalize(&config.data)?, ..config };
    let _lock = DirectoryLock::take(&config.data)?;
    let store = Arc::new(Store::open(&config.data)?);
    // This very program, even when an upgrade has replaced its file: all attempts of a service are of one build.
    let executor = Box::new(LocalExecutor::new("/proc/self/exe".into()));
    let supervisor = Supervisor::new(Arc::clone(&store), executor, config.settings());
    let inspector = inspector::start(Arc::clone(&store), "/proc/self/exe".into())?;
    let (stop, stopping) = watch::channel(false);
    let application = Application {
        store,
        supervisor: supervisor.handle(),
        inspector,
        metrics: telemetry::metrics()?,
        config: Arc::new(config),
        ready: Arc::new(AtomicBool::new(false)),
        draining: Arc::new(AtomicBool::new(false)),
        shown: ShownJobs::default(),
        archives: Arc::new(Semaphore::new(ARCHIVES)),
        stopping,
    };
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    let listener = TcpListener::bind(application.config.bind).await?;
    announce(&listener.local_addr()?.to_string())?;
    let ready = Arc::clone(&application.ready);
    let supervision = std::thread::Builder::new().name("supervisor".to_owned()).spawn(move || {
        if let Err(error) = supervisor.recover() {
            tracing::error!(%error, "recovery failed; the service stays unready");
            return;
        }
        ready.store(true, Ordering::Release);
        tracing::info!("ready");
        supervisor.run();
    })?;
    tidy_up(&application.store, application.metrics.clone())?;
    if application.config.calibrate {
        calibration::start_where_needed(&application.store, application.config.threads)?;
    }
    let handle = application.supervisor.clone();
    let draining = Arc::clone(&application.draining);
    let ready = Arc::clone(&application.ready);
    let mut stopped = application.stopping.clone();
    let answers = tokio::spawn(
        axum::serve(listener, router::router(application))
            .with_graceful_shutdown(async move {
                let _ = stopped.wait_for(|stopped| *stopped).await;
            })
            .into_future(),
    );
    tokio::select! {
        _ = terminate.recv() => {}
        _ = interrupt.recv() => {}
    }
    tracing::info!("stopping: running jobs checkpoint and go back to the queue");
    draining.store(true, Ordering::Release);
    ready.store(false, Ordering::Release);
    handle.shut_down();
    let joined = tokio::task::spawn_blocking(move || supervision.join()).await;
    if !matches!(joined, Ok(Ok(()))) {
        tracing::error!("the supervisor did not end well");
    }
    let _ = stop.send(true);
    // Whoever still reads slowly is cut off.
    let _ = tokio::time::timeout(LAST_ANSWERS, answers).await;
    Ok(())
}

/// Keeps the store's log and the samples of histograms short, on a thread of its own, for as long as there is a store.
fn tidy_up(store: &Arc<Store>, metrics: PrometheusHandle) -> std::io::Result<()> {
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

/// The first line on standard output tells where the service listens.
fn announce(address: &str) -> std::io::Result<()> {
    let mut output = std::io::stdout().lock();
    writeln!(output, "listening on http://{address}")?;
    output.flush()
}
