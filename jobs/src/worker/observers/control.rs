//! Requests to a running worker, as its run sees them.

use crate::spec::requests::Request;
use meniscus::parallel::Interrupt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Flags shared between the thread that receives requests and the run.
#[derive(Debug, Clone, Default)]
pub struct Control {
    interrupt: Interrupt,
    pausing: Arc<AtomicBool>,
    checkpoint: Arc<AtomicBool>,
}

impl Control {
    /// Takes a request.
    pub fn receive(&self, request: Request) {
        match request {
            Request::Cancel => self.interrupt.raise(),
            Request::Pause => self.pausing.store(true, Ordering::Relaxed),
            Request::Checkpoint => self.checkpoint.store(true, Ordering::Relaxed),
        }
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
