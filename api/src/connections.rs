//! Connections of clients: how many there are, how long they may be idle or slow, and how they end.
//!
//! There are fewer connections than descriptors, so that the store, workers and uploads always get theirs. At the limit the
//! oldest connections are asked to end: idle ones end at once, the others after their answer.

mod stalling;

use axum::Router;
use axum::body::Body;
use axum::http::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use rustix::process::{Resource, getrlimit};
use socket2::SockRef;
use stalling::Stalling;
use std::collections::BTreeMap;
use std::future::poll_fn;
use std::io;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore, watch};
use tokio::time::timeout;
use tower_service::Service;

/// Time that a client has for the head of a request, and that a connection may be idle.
const HEAD_TIME: Duration = Duration::from_secs(15);
/// Time without any progress after which a connection that reads or writes is closed.
const STALL_TIME: Duration = Duration::from_secs(20);
/// Bytes that wait to be sent before a connection counts as full.
const UNSENT_BYTES: u32 = 128 << 10;
/// Time for the rest of a body that was refused to come in. Before it is read the answer could be lost.
const LINGER_TIME: Duration = Duration::from_secs(2);
/// Bytes of such a rest that are read at most.
const LINGER_BYTES: usize = 64 << 20;
/// Descriptors that are kept for the store, workers, uploads and streams of files.
const KEPT_DESCRIPTORS: u64 = 200;
/// Most connections, however many descriptors there are.
const MOST_CONNECTIONS: u64 = 4096;
/// Time between two connections that are asked to end.
const ASKING_INTERVAL: Duration = Duration::from_millis(5);
/// Pause after a connection that could not be accepted, such as for want of descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Open connections by their number, each with what asks it to end.
#[derive(Debug, Clone, Default)]
struct Registry(Arc<Mutex<BTreeMap<u64, Arc<Notify>>>>);

impl Registry {
    fn enter(&self, number: u64) -> Arc<Notify> {
        let notify = Arc::new(Notify::new());
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(number, Arc::clone(&notify));
        notify
    }

    fn leave(&self, number: u64) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).remove(&number);
    }

    /// Asks the oldest connection to end that was not asked before.
    fn ask_oldest(&self, asked: &mut u64) {
        let open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((number, notify)) = open.range(*asked..).next() {
            *asked = number + 1;
            notify.notify_one();
        }
    }
}

/// Most connections that this process can have beside its work.
fn most_connections() -> usize {
    let descriptors = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
    // An answer may hold a file open.
    (descriptors.saturating_sub(KEPT_DESCRIPTORS) / 2).clamp(16, MOST_CONNECTIONS) as usize
}

/// Answers requests until the service stops. Then connections end after their present answer.
pub async fn serve(listener: TcpListener, router: Router, mut stopping: watch::Receiver<bool>) {
    let most = most_connections();
    let permits = Arc::new(Semaphore::new(most));
    let registry = Registry::default();
    let mut number = 0;
    loop {
        let permit = tokio::select! {
            permit = admit(&permits, &registry) => permit,
            _ = stopping.wait_for(|stopped| *stopped) => break,
        };
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            _ = stopping.wait_for(|stopped| *stopped) => break,
        };
        match accepted {
            Ok((stream, _)) => {
                number += 1;
                let (end, registry, router) = (registry.enter(number), registry.clone(), router.clone());
                let stopping = stopping.clone();
                tokio::spawn(async move {
                    metrics::gauge!("meniscus_connections").increment(1.0);
                    // A client that goes away in the middle is no error of the service.
                    let _ = answer(stream, router, end, stopping).await;
                    metrics::gauge!("meniscus_connections").decrement(1.0);
                    registry.leave(number);
                    drop::<OwnedSemaphorePermit>(permit);
                });
            }
            Err(error) => {
                tracing::warn!(%error, "a connection could not be accepted");
                tokio::time::sleep(ACCEPT_PAUSE).await;
            }
        }
    }
    // All connections have ended when all permits are back.
    let _ = permits.acquire_many(u32::try_from(most).unwrap_or(u32::MAX)).await;
}

/// A permit for one more connection. While there is none, the oldest connections are asked to end.
async fn admit(permits: &Arc<Semaphore>, registry: &Registry) -> OwnedSemaphorePermit {
    let mut asked = 0;
    loop {
        if let Ok(permit) = Arc::clone(permits).try_acquire_owned() {
            return permit;
        }
        registry.ask_oldest(&mut asked);
        tokio::time::sleep(ASKING_INTERVAL).await;
    }
}

/// Answers the requests of one connection.
async fn answer(
    stream: TcpStream,
    router: Router,
    end: Arc<Notify>,
    mut stopping: watch::Receiver<bool>,
) -> io::Result<()> {
    stream.set_nodelay(true)?;
    // A large buffer would hide for a long time that a slow reader goes on.
    SockRef::from(&stream).set_tcp_notsent_lowat(UNSENT_BYTES)?;
    // The router is always ready, and its future is boxed because hyper moves it.
    let service = service_fn(move |request: Request<Incoming>| Box::pin(router.clone().call(request.map(Body::new))));
    let io = TokioIo::new(Stalling::new(stream, STALL_TIME));
    let mut connection =
        http1::Builder::new().timer(TokioTimer::new()).header_read_timeout(HEAD_TIME).serve_connection(io, service);
    let mut is_asked = false;
    let finished = loop {
        let ended = poll_fn(|context| connection.poll_without_shutdown(context));
        let asked = async {
            tokio::select! {
                () = end.notified() => {}
                _ = stopping.wait_for(|stopped| *stopped) => {}
            }
        };
        tokio::select! {
            finished = ended => break finished,
            () = asked, if !is_asked => {}
        }
        is_asked = true;
        Pin::new(&mut connection).graceful_shutdown();
    };
    finished.map_err(io::Error::other)?;
    linger(connection.into_parts().io.into_inner()).await
}

/// Ends a connection so that its last answer arrives: what the client still sends is read for a while.
async fn linger(mut stream: Stalling<TcpStream>) -> io::Result<()> {
    stream.shutdown().await?;
    let mut buffer = vec![0; 1 << 14];
    let drain = async {
        let mut left = LINGER_BYTES;
        while left > 0 {
            match stream.read(&mut buffer).await? {
                0 => break,
                count => left = left.saturating_sub(count),
            }
        }
        Ok(())
    };
    timeout(LINGER_TIME, drain).await.unwrap_or(Ok(()))
}
