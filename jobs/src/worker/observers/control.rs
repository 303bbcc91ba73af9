//! Requests to a running worker: pause, cancel, checkpoint now. Nothing else flows into a run.

use meniscus::parallel::Interrupt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Shared between whoever hears requests and the run.
#[derive(Debug, Clone, Default)]
pub struct Control {
    interrupt: Interrupt,
    pausing: Arc<AtomicBool>,
    checkpoint: Arc<AtomicBool>,
}

impl Control {
    /// Drops the running step.
    pub fn cancel(&self) {
        self.interrupt.raise();
    }

    /// Ends the run after a checkpoint at the end of the step.
    pub fn pause(&self) {
        self.pausing.store(true, Ordering::Relaxed);
    }

    /// Writes a checkpoint at the end of the step.
    pub fn checkpoint(&self) {
        self.checkpoint.store(true, Ordering::Relaxed);
    }

    /// A request by its word, as the service sends it.
    pub fn hear(&self, word: &str) {
        match word.trim() {
            "cancel" => self.cancel(),
            "pause" => self.pause(),
            "checkpoint" => self.checkpoint(),
            _ => {}
        }
    }

    /// The flag that solvers poll.
    #[must_use]
    pub fn interrupt(&self) -> &Interrupt {
        &self.interrupt
    }

    /// Whether the run is to end after this step.
    #[must_use]
    pub fn is_pausing(&self) -> bool {
        self.pausing.load(Ordering::Relaxed)
    }

    /// Whether a checkpoint was asked for since the last call.
    #[must_use]
    pub fn take_checkpoint_request(&self) -> bool {
        self.checkpoint.swap(false, Ordering::Relaxed)
    }
}
