//! The service from start to end: store, supervisor, listener.

use crate::base_path;
use crate::calibration;
use crate::config::{Choices, Config};
use crate::connections;
use crate::router;
use crate::signals::{Asked, Signals};
use crate::state::{AppState, Handles, ServicePhase};
use crate::telemetry;
use meniscus_jobs::service::data_directory::{DataDirectory, DataDirectoryError};
use meniscus_jobs::service::executor::Executor;
use meniscus_jobs::service::executor::local::LocalExecutor;
use meniscus_jobs::service::executor::slurm::{SettingsError, SlurmExecutor};
use meniscus_jobs::service::found_folders::{self, DatabaseLost};
use meniscus_jobs::service::inspector;
use meniscus_jobs::service::shared_directory::{self, SharedDirectoryError};
use meniscus_jobs::service::store::{self, Store, StoreError};
use meniscus_jobs::service::supervisor::Supervisor;
use metrics_exporter_prometheus::PrometheusHandle;
use std::io::{self, Write};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tokio::sync::watch;

/// Why the service could not run.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The data directory cannot be used.
    #[error(transparent)]
    Directory(#[from] DataDirectoryError),
    /// The database was lost or is older than the files beside it.
    #[error(transparent)]
    Lost(#[from] DatabaseLost),
    /// The store cannot be opened.
    #[error("{}: {error}", path.display())]
    Store {
        /// Path of the database.
        path: PathBuf,
        /// What is wrong with it.
        error: StoreError,
    },
    /// The address cannot be used.
    #[error("{address} cannot be used: {error}; {}", advice(error))]
    Bind {
        /// The address.
        address: SocketAddr,
        /// What the system said.
        error: io::Error,
    },
    /// The directory that nodes see cannot be used.
    #[error(transparent)]
    Shared(#[from] SharedDirectoryError),
    /// The cluster cannot be used.
    #[error(transparent)]
    Cluster(#[from] SettingsError),
    /// A call of the operating system failed, such as binding the address.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// What helps where an address cannot be used.
fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::AddrInUse => {
            "another program listens there: stop it, or give --bind another port (port 0 picks a free one)"
        }
        io::ErrorKind::PermissionDenied => "ports below 1024 need a privilege: give --bind a higher port",
        io::ErrorKind::AddrNotAvailable => "this machine does not have the address: give --bind one of its own",
        _ => "give --bind another address",
    }
}

/// Time between two checks of the store's log.
const LOG_INTERVAL: Duration = Duration::from_millis(250);
/// Time between two tries whether the store can be written.
const WRITE_INTERVAL: Duration = Duration::from_secs(2);
/// Time between two looks at the token file.
const TOKEN_INTERVAL: Duration = Duration::from_secs(1);
/// Time that open answers have to end after the supervisor has ended.
const LAST_ANSWERS: Duration = Duration::from_secs(1);

/// Runs the service until SIGTERM or SIGINT. Running jobs then write a checkpoint and return to the queue.
///
/// # Errors
/// [`ServeError`].
pub async fn serve(config: Config, reloading: Reloading) -> Result<(), ServeError> {
    base_path::set(&config.base_path);
    let directory = DataDirectory::open(&config.data)?;
    let config = Config { data: directory.path().to_owned(), ..config };
    let bind = config.bind;
    let listener = TcpListener::bind(bind).await.map_err(|error| ServeError::Bind { address: bind, error })?;
    let config = share(config, &directory)?;
    let store = Arc::new(open_store(&directory, config.adopt)?);
    let (stop, stopping) = watch::channel(false);
    let (state, supervisor) = build(config, &store, stopping)?;
    let mut signals = Signals::new()?;
    announce(&listener.local_addr()?.to_string())?;
    let supervision = start_supervision(supervisor, state.phase.clone())?;
    tidy_up(&state.store, state.metrics.clone(), state.phase.clone())?;
    if let Some(file) = state.config.token_file.clone() {
        watch_tokens(file, state.config.clone(), reloading.clone(), state.phase.clone())?;
    }
    if state.config.calibrate {
        calibration::start_where_needed(&state.store, state.config.threads)?;
    }
    let answers = tokio::spawn(connections::serve(listener, router::router(state.clone()), state.stopping.clone()));
    while signals.next().await == Asked::Reload {
        reload(&state.config, &reloading);
    }
    tracing::info!("stopping: running jobs write a checkpoint and return to the queue");
    state.phase.set_draining();
    state.supervisor.shut_down();
    drop(state);
    let joined = tokio::task::spawn_blocking(move || supervision.join()).await;
    if !matches!(joined, Ok(Ok(()))) {
        tracing::error!("the supervisor ended with an error");
    }
    let _ = stop.send(true);
    // Clients that still read are cut off after a moment.
    let _ = tokio::time::timeout(LAST_ANSWERS, answers).await;
    store.close();
    Ok(())
}

/// Where settings come from when they are read again.
#[derive(Debug, Clone, Default)]
pub struct Reloading {
    /// The flags of the command line.
    pub flags: Choices,
    /// The configuration file.
    pub file: Option<PathBuf>,
}

/// Reads tokens, host names and origins again. What is wrong leaves everything as it is.
fn reload(config: &Config, Reloading { flags, file }: &Reloading) {
    let read = file.as_deref().map(Choices::from_file).transpose();
    let read = read.map(|file| flags.clone().or(file.unwrap_or_default()));
    match read.and_then(|choices| config.reload(&choices)) {
        Ok(()) => tracing::info!("tokens, host names and origins are read again; other settings need a restart"),
        Err(error) => tracing::error!(%error, "settings could not be read again; the ones before stay"),
    }
}

/// Opens the store, if it knows everything that is on the disk. With `adopt`, what it does not know comes back into it.
fn open_store(directory: &DataDirectory, adopt: bool) -> Result<Store, ServeError> {
    let path = directory.path().join(store::FILE_NAME);
    let failed = |error: StoreError| ServeError::Store { path: path.clone(), error };
    let is_missing = !path.is_file();
    // A lost database must not be replaced by an empty one before this is seen.
    if is_missing && !adopt {
        let found = found_folders::compare(directory.path(), None).map_err(failed)?;
        if !found.is_nothing_lost() {
            return Err(found.lost(directory.path(), true).into());
        }
    }
    let store = Store::open(directory.path()).map_err(failed)?;
    let found = found_folders::compare(directory.path(), Some(&store)).map_err(failed)?;
    if !found.is_nothing_lost() && !adopt {
        store.close();
        return Err(found.lost(directory.path(), false).into());
    }
    found_folders::adopt(&store, &found).map_err(failed)?;
    found_folders::set_aside(directory.path(), &found.orphans)?;
    Ok(store)
}

/// Puts what the nodes of a cluster see into the shared directory, where there is one.
fn share(mut config: Config, directory: &DataDirectory) -> Result<Config, ServeError> {
    if let Some(slurm) = &mut config.slurm {
        slurm.shared = shared_directory::link(directory, &slurm.shared, config.adopt)?;
        slurm.settings.service_id = directory.id().to_owned();
    }
    Ok(config)
}

/// Makes everything that handlers need, and the supervisor, which does not run yet.
fn build(
    config: Config,
    store: &Arc<Store>,
    stopping: watch::Receiver<bool>,
) -> Result<(AppState, Supervisor), ServeError> {
    let store = Arc::clone(store);
    let executor: Box<dyn Executor> = match &config.slurm {
        Some(slurm) => Box::new(SlurmExecutor::new(slurm.settings.clone(), &slurm.shared)?),
        // The running program, even if an upgrade has replaced its file: all workers of a service are of one build.
        None => Box::new(LocalExecutor::new("/proc/self/exe".into())),
    };
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

/// Trims the store's log and the samples of histograms, and tries whether the store can be written, as long as the store
/// exists, on a thread of its own.
fn tidy_up(store: &Arc<Store>, metrics: PrometheusHandle, phase: ServicePhase) -> io::Result<()> {
    let mut changes = store.watch();
    let store = Arc::downgrade(store);
    let mut tried = Instant::now();
    std::thread::Builder::new().name("tidy-up".to_owned()).spawn(move || {
        loop {
            std::thread::sleep(LOG_INTERVAL);
            if phase.is_draining() {
                return;
            }
            let Some(store) = store.upgrade() else { return };
            metrics.run_upkeep();
            let is_idle = !changes.has_changed().unwrap_or(true);
            changes.mark_unchanged();
            if let Err(error) = store.trim_log(is_idle) {
                tracing::warn!(%error, "the store's log could not be trimmed");
            }
            let interval = if phase.is_writable() { WRITE_INTERVAL } else { LOG_INTERVAL };
            if tried.elapsed() >= interval {
                tried = Instant::now();
                try_writing(&store, &phase);
            }
        }
    })?;
    Ok(())
}

/// Reads the tokens again when their file has changed, on a thread of its own.
fn watch_tokens(file: PathBuf, config: Arc<Config>, reloading: Reloading, phase: ServicePhase) -> io::Result<()> {
    let look = move || std::fs::metadata(&file).and_then(|meta| Ok((meta.modified()?, meta.len()))).ok();
    let mut known = look();
    std::thread::Builder::new().name("tokens".to_owned()).spawn(move || {
        while !phase.is_draining() {
            std::thread::sleep(TOKEN_INTERVAL);
            let found = look();
            // A file that is being replaced is not there for a moment.
            if found.is_some() && found != known {
                known = found;
                reload(&config, &reloading);
            }
        }
    })?;
    Ok(())
}

/// Tries whether the store can be written; a service that cannot keep what it promises is not ready.
fn try_writing(store: &Store, phase: &ServicePhase) {
    let tried = store.try_writing();
    match &tried {
        Err(error) if phase.is_writable() => {
            tracing::error!(%error, "the data directory cannot be written; the service is not ready");
        }
        Ok(()) if !phase.is_writable() => tracing::info!("the data directory can be written again"),
        _ => {}
    }
    phase.set_writable(tried.is_ok());
}

/// Writes the address of the service as the first line on standard output.
fn announce(address: &str) -> io::Result<()> {
    let mut output = io::stdout().lock();
    writeln!(output, "listening on http://{address}")?;
    output.flush()
}
