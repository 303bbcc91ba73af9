//! Signals: SIGTERM, SIGINT and SIGQUIT stop the service. SIGHUP reads settings again, or stops a service whose terminal was
//! closed.

use std::fs::File;
use std::io;
use tokio::signal::unix::{Signal, SignalKind, signal};

/// What a signal asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// An orderly stop.
    Stop,
    /// Settings that may change are to be read again.
    Reload,
}

/// The signals of this process.
#[derive(Debug)]
pub struct Signals {
    stops: [Signal; 3],
    hangup: Signal,
    /// Whether the service was started from a terminal.
    has_terminal: bool,
}

impl Signals {
    /// Receives signals from now on.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn new() -> io::Result<Self> {
        let stops = [SignalKind::terminate(), SignalKind::interrupt(), SignalKind::quit()];
        let [terminate, interrupt, quit] = stops.map(signal);
        Ok(Self {
            stops: [terminate?, interrupt?, quit?],
            hangup: signal(SignalKind::hangup())?,
            has_terminal: opens_terminal(),
        })
    }

    /// Waits for the next one.
    pub async fn next(&mut self) -> Asked {
        let [terminate, interrupt, quit] = &mut self.stops;
        tokio::select! {
            _ = terminate.recv() => Asked::Stop,
            _ = interrupt.recv() => Asked::Stop,
            _ = quit.recv() => Asked::Stop,
            _ = self.hangup.recv() => {
                if self.has_terminal && !opens_terminal() { Asked::Stop } else { Asked::Reload }
            }
        }
    }
}

/// Whether the process has a controlling terminal that opens.
fn opens_terminal() -> bool {
    File::open("/dev/tty").is_ok()
}
