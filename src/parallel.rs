//! What parallel loops need: storage per thread that outlives the loop, and a flag that ends work early.
//!
//! Every loop computes each item from inputs that the loop does not change and writes it once, so results do not
//! depend on how items are shared out among threads.

use rayon::iter::{IndexedParallelIterator, MaxLen};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Items per task of a parallel loop: small enough to balance and to notice an interrupt soon.
pub const BLOCK: usize = 32;

/// The blocks of a parallel loop, each a task of its own: of the halves of halves that are shared out otherwise the last one keeps one
/// thread busy while the others wait, at the end of every loop.
pub fn one_by_one<I: IndexedParallelIterator>(blocks: I) -> MaxLen<I> {
    blocks.with_max_len(1)
}

/// Asks a running step to be dropped. Clones share the flag.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

/// The step was dropped because somebody asked for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Interrupted;

impl Interrupt {
    /// Asks to stop.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether somebody asked.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// An error once somebody asked.
    ///
    /// # Errors
    /// [`Interrupted`].
    pub fn check(&self) -> Result<(), Interrupted> {
        if self.is_raised() { Err(Interrupted) } else { Ok(()) }
    }
}

/// One reusable value for each thread of the pool that runs the loop.
#[derive(Debug)]
pub struct PerThread<T> {
    slots: Vec<Slot<T>>,
}

/// Cache lines of its own, two since they are fetched in pairs: threads that write side by side would wait for each other.
#[derive(Debug, Default)]
#[repr(align(128))]
struct Slot<T>(Mutex<T>);

impl<T: Default> PerThread<T> {
    /// Values for the pool of the current thread.
    #[must_use]
    pub fn new() -> Self {
        Self { slots: (0..=rayon::current_num_threads()).map(|_| Slot::default()).collect() }
    }

    /// Lends this thread's value. Threads outside the pool share the last one.
    pub fn with<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        let last = self.slots.len() - 1;
        let index = rayon::current_thread_index().unwrap_or(last).min(last);
        let mut slot = self.slots[index].0.lock().unwrap_or_else(PoisonError::into_inner);
        work(&mut slot)
    }
}

impl<T: Default> Default for PerThread<T> {
    fn default() -> Self {
        Self::new()
    }
}
