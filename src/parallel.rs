//! Helpers of parallel loops: workspaces per thread that outlive a loop, and a flag that drops a running step.
//!
//! A loop computes each item from inputs that the loop does not change, and writes it once. Results therefore do not
//! depend on the number of threads or on how they share the items.

use rayon::iter::{IndexedParallelIterator, MaxLen};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Items per task of a parallel loop. Small blocks balance the load and notice an interrupt soon.
pub const BLOCK: usize = 32;

/// Makes each block of a parallel loop a task of its own.
///
/// By default rayon splits a loop into halves of halves. At the end of a loop the last of these keeps one thread busy
/// while the others wait.
pub fn one_by_one<I: IndexedParallelIterator>(blocks: I) -> MaxLen<I> {
    blocks.with_max_len(1)
}

/// A flag that asks for the running step to be dropped. Clones share the flag.
///
/// ```
/// use meniscus::parallel::{Interrupt, Interrupted};
///
/// let interrupt = Interrupt::default();
/// let solver = interrupt.clone();
/// assert_eq!(solver.check(), Ok(()));
/// interrupt.raise();
/// assert_eq!(solver.check(), Err(Interrupted));
/// ```
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

/// The step was dropped because its [`Interrupt`] was raised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Interrupted;

impl Interrupt {
    /// Asks for the running step to be dropped.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether [`Self::raise`] was called.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Turns a raised flag into an error, for use with `?`.
    ///
    /// # Errors
    /// [`Interrupted`] when the flag is raised.
    pub fn check(&self) -> Result<(), Interrupted> {
        if self.is_raised() { Err(Interrupted) } else { Ok(()) }
    }
}

/// One reusable workspace for each thread of the pool that runs the loop.
#[derive(Debug)]
pub struct PerThread<T> {
    slots: Vec<Slot<T>>,
}

/// A value with cache lines of its own, so that threads do not wait for each other's writes. Processors fetch lines of
/// 64 bytes in pairs, hence 128.
#[derive(Debug, Default)]
#[repr(align(128))]
struct Slot<T>(Mutex<T>);

impl<T: Default> PerThread<T> {
    /// Default values for all threads of the current pool, and one for threads outside it.
    #[must_use]
    pub fn new() -> Self {
        Self { slots: (0..=rayon::current_num_threads()).map(|_| Slot::default()).collect() }
    }

    /// Calls `work` with this thread's value. Threads outside the pool share the last value.
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
