//! Requests to a running worker, as its run sees them.

use crate::spec::requests::Request;
use crate::spec::states::Reason;
use crate::system::process;
use meniscus::parallel::Interrupt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Time that a run has to come to the end of its step after a request to pause. Then the step, or the measurement, is
/// dropped.
const PATIENCE: Duration = Duration::from_millis(1000);

/// Flags shared between the thread that receives requests and the run.
#[derive(Debug, Clone, Default)]
pub struct Control {
    interrupt: Interrupt,
    canceled: Arc<AtomicBool>,
    pause_reason: Arc<Mutex<Option<Reason>>>,
    pausing: Arc<AtomicBool>,
    checkpoint: Arc<AtomicBool>,
}

impl Control {
    /// Takes a request.
    pub fn receive(&self, request: Request) {
        match request {
            Request::Cancel => {
                self.canceled.store(true, Ordering::Relaxed);
                self.interrupt.raise();
            }
            Request::Pause => self.pause(None),
            Request::Drain => self.pause(Some(Reason::ServerRestart)),
            // What was asked before holds.
            Request::Evict if self.is_pausing() => {}
            Request::Evict => self.pause(Some(Reason::WorkerEvicted)),
            Request::Checkpoint => self.checkpoint.store(true, Ordering::Relaxed),
            Request::Stop => process::end_at_once(),
        }
    }

    fn pause(&self, reason: Option<Reason>) {
        *self.pause_reason.lock().unwrap_or_else(PoisonError::into_inner) = reason;
        self.pausing.store(true, Ordering::Relaxed);
        self.lose_patience_later();
    }

    /// Raises the interrupt after a while.
    fn lose_patience_later(&self) {
        let interrupt = self.interrupt.clone();
        let started = std::thread::Builder::new().name("patience".to_owned()).spawn(move || {
            std::thread::sleep(PATIENCE);
            interrupt.raise();
        });
        if started.is_err() {
            self.interrupt.raise();
        }
    }

    /// Whether the run is to drop everything.
    #[must_use]
    pub fn is_canceled(&self) -> bool {
        self.canceled.load(Ordering::Relaxed)
    }

    /// Why the run pauses, where it is not on a client's request.
    #[must_use]
    pub fn pause_reason(&self) -> Option<Reason> {
        *self.pause_reason.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the run is to end with its state kept.
    #[must_use]
    pub fn is_only_pausing(&self) -> bool {
        self.is_pausing() && !self.is_canceled()
    }

    /// The flag that solvers poll: the step in progress is dropped.
    #[must_use]
    pub fn interrupt(&self) -> &Interrupt {
        &self.interrupt
    }

    /// Whether the run ends after this step.
    #[must_use]
    pub fn is_pausing(&self) -> bool {
        self.pausing.load(Ordering::Relaxed)
    }

    /// Whether a checkpoint was requested since the last call.
    #[must_use]
    pub fn take_checkpoint_request(&self) -> bool {
        self.checkpoint.swap(false, Ordering::Relaxed)
    }
}
