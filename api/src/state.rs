//! What every handler can reach: store, supervisor, configuration. Nothing here knows a route or an error of the API.

use crate::access::tickets::Tickets;
use crate::config::Config;
use crate::response_cache::ResponseCache;
use meniscus_jobs::service::inspector::InspectorHandle;
use meniscus_jobs::service::store::Store;
use meniscus_jobs::service::supervisor::SupervisorHandle;
use metrics_exporter_prometheus::PrometheusHandle;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::watch;
use tokio::task::JoinError;

/// State of the service, shared by all handlers. A clone is cheap and refers to the same service.
#[derive(Clone)]
pub struct AppState {
    /// Database and files of the data directory.
    pub store: Arc<Store>,
    /// Starts, pauses and ends workers.
    pub supervisor: SupervisorHandle,
    /// Starts the processes that examine uploads.
    pub inspector: InspectorHandle,
    /// Renders the counters and gauges for operators.
    pub metrics: PrometheusHandle,
    /// Configuration of the service.
    pub config: Arc<Config>,
    /// How far the service is between its start and its end.
    pub phase: ServicePhase,
    /// Serialized jobs.
    pub response_cache: ResponseCache,
    /// Tickets that are good now.
    pub tickets: Tickets,
    /// Turns true when the service stops; streams and long polls end then.
    pub stopping: watch::Receiver<bool>,
}

/// Whether the service has recovered its jobs, can write its data directory, and is shutting down.
#[derive(Debug, Clone, Default)]
pub struct ServicePhase {
    ready: Arc<AtomicBool>,
    unwritable: Arc<AtomicBool>,
    draining: Arc<AtomicBool>,
}

impl ServicePhase {
    /// Whether recovery is complete and no shutdown has begun.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.ready.load(Ordering::Acquire)
    }

    /// Whether a shutdown has begun. The store can still be read.
    #[must_use]
    pub fn is_draining(&self) -> bool {
        self.draining.load(Ordering::Acquire)
    }

    /// Whether the data directory could be written when it was last tried.
    #[must_use]
    pub fn is_writable(&self) -> bool {
        !self.unwritable.load(Ordering::Acquire)
    }

    /// Notes whether the data directory can be written.
    pub fn set_writable(&self, is_writable: bool) {
        self.unwritable.store(!is_writable, Ordering::Release);
    }

    /// Marks the end of recovery.
    pub fn set_ready(&self) {
        self.ready.store(true, Ordering::Release);
    }

    /// Marks the begin of a shutdown.
    pub fn set_draining(&self) {
        self.draining.store(true, Ordering::Release);
        self.ready.store(false, Ordering::Release);
    }
}

/// Handles that the service has when it starts.
pub struct Handles {
    /// See [`AppState::store`].
    pub store: Arc<Store>,
    /// See [`AppState::supervisor`].
    pub supervisor: SupervisorHandle,
    /// See [`AppState::inspector`].
    pub inspector: InspectorHandle,
    /// See [`AppState::metrics`].
    pub metrics: PrometheusHandle,
}

impl AppState {
    /// The state of a service that is about to start.
    #[must_use]
    pub fn new(handles: Handles, config: Config, stopping: watch::Receiver<bool>) -> Self {
        let Handles { store, supervisor, inspector, metrics } = handles;
        Self {
            store,
            supervisor,
            inspector,
            metrics,
            config: Arc::new(config),
            phase: ServicePhase::default(),
            response_cache: ResponseCache::default(),
            tickets: Tickets::default(),
            stopping,
        }
    }

    /// Runs work on the store on a thread that may wait for the disk.
    ///
    /// # Errors
    /// Errors of the work, or [`JoinError`] if it panicked.
    pub async fn with_store<R, E>(&self, work: impl FnOnce(&Store) -> Result<R, E> + Send + 'static) -> Result<R, E>
    where
        R: Send + 'static,
        E: From<JoinError> + Send + 'static,
    {
        let store = Arc::clone(&self.store);
        // Log lines of the work carry the id of the request.
        let span = tracing::Span::current();
        tokio::task::spawn_blocking(move || span.in_scope(|| work(&store))).await?
    }
}
